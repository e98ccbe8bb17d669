"""The lines of the attack: where files go in and out, options and contents that cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

SOLVE = "--d1 17.5 --d2 9.5 --c1 35 --c2 19"
WATER = "--water-level 1 --index 1.34"
CURVE = "multimedia epipolar tank.toml --camera cam1 --to cam2"
RING = "multimedia design --distance 0.6 --c 25 --extent 0.3x0.3 --depths 0.02x0.2"
CANON = "bifocal plan --focal 35 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048"
ALIGN = "bifocal align far.jpg near.jpg --focal1 35 --focal2 19 --sensor-width 22.7 --out o.json"
SITE = "--distance1 17.5 --distance2 9.5"

#: A line with {} where a file goes in, a valid file of its kind, and the kinds that are no fault.
INPUTS: list[tuple[str, ...]] = [
    ("bifocal calibrate {} --out o.json", "far.jpg"),
    ("bifocal calibrate far.jpg --lines {} --out o.json", "lines.csv", "half"),
    ("bifocal calibrate {} --straight-edges --out o.json", "far.jpg"),
    ("bifocal calibrate {} --database --out o.json", "far.jpg"),
    ("bifocal undistort {} --lens lens.json", "far.jpg", "photo"),
    ("bifocal undistort far.jpg --lens {}", "lens.json"),
    ("bifocal undistort far.jpg --lens {}", "lens.xml"),
    ("bifocal undistort far.jpg --lens {}", "lens.yml"),
    ("bifocal undistort far.jpg --lens {}", "lens.txt"),
    (ALIGN.replace("far.jpg", "{}") + f" {SITE}", "far.jpg", "photo"),
    (ALIGN + " --control {}", "control.csv", "half"),
    (ALIGN + f" {SITE} --lens {{}}", "lens.json"),
    (ALIGN + " --control control.csv --lengths {}", "lengths.csv"),
    ("bifocal match {} --out o.xlsx", "wall.pair.json"),
    ("bifocal solve {} --out o.xlsx", "survey.xlsx"),
    ("bifocal solve {} --json " + SOLVE, "survey.ods"),
    ("bifocal solve {} --json " + SOLVE, "survey.csv", "half"),
    ("bifocal solve picks.csv --json --pair {}", "wall.pair.json"),
    ("bifocal relief {} --out o.tif", "wall.pair.json"),
    ("bifocal ortho {} --plane --out o.tif", "wall.pair.json"),
    ("bifocal ortho wall.pair.json --out o.tif --relief {}", "relief.tif"),
    ("bifocal ortho wall.pair.json --out o.tif --points {}", "result.csv", "half"),
    ("bifocal mosaic {} ortho2.tif --out o.tif", "ortho1.tif"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out o.tif --relief {}", "relief.tif"),
    ("bifocal export {} --out o.dxf", "result.csv", "half"),
    ("bifocal export {} --out o.dxf", "survey.xlsx"),
    ("multimedia shift {} --z0 1 --indices 1,1.337 --json", "shift.csv", "half"),
    ("multimedia shift {} --json", "shift.xlsx"),
    ("multimedia project {} --json", "tank.toml"),
    ("multimedia project tank.toml --json --points {}", "shift.csv", "half"),
    ("multimedia intersect {} --json", "tank.toml"),
    ("multimedia intersect tank.toml --json --points {}", "tank_image_points.csv", "half"),
    ("multimedia resect {} --out o.toml", "tank.toml"),
    ("multimedia adjust {} --out o.toml", "tank.toml"),
    ("multimedia epipolar {} --camera cam1 --to cam2 --json", "tank.toml"),
    (CURVE + " --picture o.png --photo {}", "far.jpg", "photo"),
    ("multimedia bathymetry {} --out o.tif " + WATER, "dem.tif"),
    ("multimedia bathymetry {} --out o.csv " + WATER, "cloud.csv", "half"),
    ("multimedia bathymetry {} --out o.ply " + WATER, "cloud.ply"),
    ("multimedia bathymetry {} --out o.las " + WATER, "cloud.las"),
    ("multimedia bathymetry {} --out o.laz " + WATER, "cloud.laz"),
    ("multimedia bathymetry cloud.csv --out o.csv --index 1.34 --water-level {}", "water.json"),
    ("multimedia bathymetry cloud.csv --out o.csv --index 1.34 --water-level {}", "dem.tif"),
    ("multimedia bathymetry cloud.csv --out o.csv --index 1.34 --water-level {}", "mesh.ply"),
    (f"multimedia bathymetry cloud.csv --out o.csv {WATER} --cameras {{}}", "eyes.csv", "half"),
    (f"multimedia bathymetry cloud.csv --out o.csv {WATER} --cameras {{}}", "tank.toml"),
    (
        f"multimedia bathymetry cloud.las --out o.las {WATER} --trajectory {{}}",
        "flight.csv",
    ),
    (f"multimedia bathymetry {{}} --rays --out o.csv {WATER}", "rays.csv", "half"),
    ("multimedia waterlevel {} --out o.json", "cloud.csv", "half"),
    ("multimedia waterlevel {} --out o.json", "cloud.ply"),
    ("multimedia openptv {} --out o.toml", "ptv", "half"),
    ("multimedia openptv {} --export o", "tank.toml"),
    ("multimedia design {} --json", "tank.toml"),
]

#: A line with {} where a file is written, the ending it has, and the places that are no fault.
OUTPUTS: list[tuple[str, ...]] = [
    ("bifocal template {}", ".xlsx"),
    (f"{CANON} --scale 500 --out {{}}", ".xlsx"),
    ("bifocal calibrate far.jpg --lines lines.csv --out {}", ".json"),
    (ALIGN.replace("o.json", "{}") + " --control control.csv", ".json"),
    (ALIGN + " --control control.csv --picture {}", ".png"),
    ("bifocal match wall.pair.json --out {}", ".xlsx"),
    ("bifocal match wall.pair.json --out {}", ".csv"),
    (f"bifocal solve survey.csv {SOLVE} --out {{}}", ".xlsx"),
    (f"bifocal solve survey.csv {SOLVE} --out {{}}", ".csv"),
    ("bifocal relief wall.pair.json --out {}", ".tif"),
    ("bifocal relief wall.pair.json --out o1.tif --preview {}", ".png"),
    ("bifocal relief wall.pair.json --out o1.tif --cloud {}", ".ply"),
    ("bifocal ortho wall.pair.json --plane --out {}", ".tif"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out {}", ".tif"),
    *(("bifocal export result.csv --out {}", e) for e in (
        ".dxf", ".ply", ".las", ".laz", ".csv", ".geojson", ".xlsx",
    )),
    ("multimedia template {}", ".xlsx"),
    ("multimedia shift shift.csv --z0 1 --indices 1,1.337 --out {}", ".csv"),
    ("multimedia shift shift.csv --z0 1 --indices 1,1.337 --out {}", ".xlsx"),
    ("multimedia project tank.toml --out {}", ".csv"),
    ("multimedia intersect tank.toml --out {}", ".xlsx"),
    ("multimedia resect tank.toml --out {}", ".toml"),
    ("multimedia resect tank.toml --residuals {}", ".csv"),
    ("multimedia adjust tank.toml --out {}", ".toml"),
    ("multimedia adjust tank.toml --report {}", ".html"),
    (CURVE + " --out {}", ".csv"),
    (CURVE + " --picture {}", ".png"),
    (f"multimedia bathymetry dem.tif {WATER} --out {{}}", ".tif"),
    *((f"multimedia bathymetry cloud{e} {WATER} --out {{}}", e) for e in (
        ".csv", ".ply", ".las", ".laz",
    )),
    ("multimedia waterlevel cloud.csv --out {}", ".json"),
    ("multimedia openptv ptv --out {}", ".toml"),
    ("multimedia design tank.toml --out {}", ".xlsx"),
    ("multimedia design tank.toml --plot {}", ".png"),
]


DELIVER = "bifocal ortho wall.pair.json --relief relief.tif --deliver d --any-size"
ORTHO = "bifocal ortho wall.pair.json --out o.tif"
ADJUST = "multimedia adjust tank.toml"
SHIFT = "multimedia shift shift.csv --json"
BATHY = "multimedia bathymetry cloud.csv --out o.csv"
LIDAR = "multimedia bathymetry cloud.las --out o.las"
LINES = "bifocal calibrate far.jpg --lines lines.csv --out o.json"

#: Options that cannot be meant, one by one or together, and what the refusal must name.
WORDS: list[tuple[str, str]] = [
    ("bifocal slove survey.csv", "'slove'.*Did you mean 'solve'"),
    ("bifocal facade-all", "No such command"),
    ("multimedia shfit shift.csv", "Did you mean 'shift'"),
    ("bifocal solve", "SURVEY"),
    ("bifocal solve survey.csv picks.csv", "picks.csv"),
    ("bifocal solve survey.csv --nonsense", "--nonsense"),
    ("bifocal solve survey.csv --d1", "--d1"),
    ("bifocal demo --out far.jpg", "far.jpg"),
    ("bifocal demo --out lens.json/d", "lens.json"),
    ("bifocal template o.ods", "o.ods"),
    ("bifocal template o", "o: "),
    ("bifocal template o.xlsx --lang fr", "--lang.*fr"),
    ("bifocal template o.xlsx --rows 0", "rows"),
    ("bifocal template o.xlsx --rows -5", "rows"),
    ("bifocal template o.xlsx --rows 9999999", "rows"),
    ("bifocal template o.xlsx --rows many", "--rows"),
    ("bifocal plan", "--focal"),
    (CANON, "size of the wall.*scale.*GSD.*sigma"),
    (f"{CANON} --scale 0", "--scale"),
    (f"{CANON} --scale 1:0", "--scale"),
    (f"{CANON} --scale -500", "--scale"),
    (f"{CANON} --scale 1e300", "--scale"),
    (f"{CANON} --gsd 0", "--gsd"),
    (f"{CANON} --object 12", "--object"),
    (f"{CANON} --object 0x8", "--object"),
    (f"{CANON} --object nanx8", "--object"),
    (f"{CANON} --sigma-r -1", "--sigma-r"),
    (f"{CANON} --scale 500 --sigma-px 0", "--sigma-px"),
    (f"{CANON} --scale 500 --sigma-r-max 0", "--sigma-r-max"),
    (f"{CANON} --scale 500 --free-space 0", "--free-space"),
    (f"{CANON} --scale 500 --free-space 1", "free"),
    (f"{CANON} --scale 500 --gsd 3", "one|--scale|--gsd"),
    (f"{CANON} --scale 500 --out o.pdf", "o.pdf"),
    (f"{CANON} --scale 500 --out o.csv", "o.csv"),
    (f"{CANON.replace('--focal 19 ', '')} --scale 500", "focal"),
    (f"{CANON.replace('--focal 19', '--focal 35')} --scale 500", "focal"),
    (f"{CANON.replace('22.7x15.1', '22.7')} --scale 500", "--sensor"),
    (f"{CANON.replace('22.7x15.1', '-22.7x15.1')} --scale 500", "--sensor"),
    (f"{CANON.replace('3072x2048', '1e9x1e9')} --scale 500", "--pixels|pixels"),
    ("bifocal calibrate --out o.json", "IMAGE"),
    ("bifocal calibrate far.jpg", "--out"),
    ("bifocal calibrate far.jpg --out o.json --pattern circles", "--board"),
    ("bifocal calibrate far.jpg --out o.json --pattern dots", "--pattern"),
    ("bifocal calibrate far.jpg --out o.json --board 1x1", "board"),
    ("bifocal calibrate far.jpg --out o.json --board 9", "--board"),
    ("bifocal calibrate far.jpg --out o.json --board 99999x99999", "board"),
    ("bifocal calibrate far.jpg --out o.json --model k9", "--model"),
    (f"{LINES} --database", "one of"),
    (f"{LINES} --focal-px 1e16", "--focal-px"),
    ("bifocal calibrate far.jpg --out o.json --database", "far.jpg"),
    ("bifocal calibrate far.jpg --out o.json --database --camera-name Nonesuch --lens-name X "
     "--focal 35", "Nonesuch|lens"),
    ("bifocal calibrate far.jpg --out o.json --database --focal 0", "--focal"),
    ("bifocal undistort far.jpg --lens exif", "far.jpg"),
    ("bifocal undistort far.jpg", "--lens"),
    ("bifocal undistort far.jpg --lens lens.json --out-dir nowhere", "nowhere"),
    ("bifocal undistort far.jpg --lens lens.json --out-dir lens.json", "lens.json"),
    ("bifocal undistort far.jpg --lens wall.pair.json", "wall.pair.json"),
    ("bifocal undistort far.jpg --lens relief.tif", "relief.tif"),
    ("bifocal undistort far.jpg far.jpg --lens lens.json", "far"),
    (ALIGN, "--control|--distance1|--auto"),
    (f"{ALIGN} --auto", "distance|length"),
    (f"{ALIGN} --distance1 17.5", "distance|match|view|common"),
    (f"{ALIGN} --distance1 9.5 --distance2 17.5", "distance|view|focal"),
    (f"{ALIGN} {SITE} --delta-d 3", "delta-d|distance|view"),
    (f"{ALIGN} {SITE} --wall 3", "--wall"),
    (f"{ALIGN} {SITE} --wall -999,5", "wall|view"),
    (f"{ALIGN} {SITE} --length 1,2,3,4", "--length"),
    (f"{ALIGN} {SITE} --length 1,2,1,2,5", "length|view"),
    (f"{ALIGN} {SITE} --horizontal 1,1,1", "--horizontal"),
    (f"{ALIGN} {SITE} --sensor-width1 0", "--sensor-width1"),
    (f"{ALIGN} {SITE} --pixel-size -1", "--pixel-size"),
    (f"{ALIGN} {SITE} --sigma-distance -1", "--sigma-distance"),
    (f"{ALIGN} --control control.csv --unit ft", "--unit"),
    (f"{ALIGN} --control control.csv --sigma-pick 0", "--sigma-pick"),
    (f"{ALIGN} --control control.csv --sigma-control 0", "--sigma-control"),
    (f"{ALIGN} --control control.csv --picture o.doc", "o.doc"),
    (f"{ALIGN} --control control.csv --picture o.json", "o.json"),
    (f"{ALIGN} --control survey.csv", "survey.csv"),
    ("bifocal align far.jpg far.jpg --distance1 17.5 --distance2 9.5 --focal1 35 --focal2 19 "
     "--sensor-width 22.7 --out o.json", "same photo"),
    ("bifocal align far.jpg near.jpg --distance1 17.5 --distance2 9.5 --out o.json", "--focal1"),
    ("bifocal align far.jpg near.jpg --distance1 17.5 --distance2 9.5 --sensor-width 22.7 "
     "--out o.json", "--focal1"),
    ("bifocal match wall.pair.json", "--out"),
    ("bifocal match wall.pair.json --out o.pdf", "o.pdf"),
    ("bifocal match wall.pair.json --out o.xlsx --count 0", "--count"),
    ("bifocal match wall.pair.json --out o.xlsx --count 1e9", "--count"),
    ("bifocal match wall.pair.json --out o.xlsx --what all,none", "--what"),
    ("bifocal match wall.pair.json --out o.xlsx --relief-min 3 --relief-max -3", "relief"),
    (f"bifocal solve survey.csv {SOLVE} --columns id=A,x1=nope", "nope"),
    (f"bifocal solve survey.csv {SOLVE} --columns id=A,x9=B", "x9"),
    (f"bifocal solve survey.csv {SOLVE} --columns id=A,x1=A", "A"),
    (f"bifocal solve survey.csv {SOLVE} --columns ==", "--columns|="),
    (f"bifocal solve survey.csv {SOLVE} --columns id=ZZZZ9", "ZZZZ9"),
    (f"bifocal solve survey.xlsx {SOLVE} --sheet Nonesuch", "Nonesuch"),
    (f"bifocal solve survey.csv {SOLVE} --decimal dot", "--decimal"),
    (f"bifocal solve survey.csv {SOLVE} --out o.pdf", "o.pdf"),
    (f"bifocal solve survey.csv {SOLVE} --out survey.csv --overwrite", "survey.csv"),
    ("bifocal solve survey.csv --json", "d1|set-up|c1"),
    ("bifocal solve survey.csv --d1 9.5 --d2 9.5 --c1 35 --c2 19 --json", "d_1"),
    ("bifocal solve survey.csv --d1 1e-300 --d2 9.5 --c1 35 --c2 19 --json", "homography"),
    ("bifocal solve survey.csv --d1 1e9 --d2 9.5 --c1 35 --c2 19 --json", "d1|distance"),
    ("bifocal solve survey.csv --d1 17.5 --d2 9.5 --c1 0 --c2 19 --json", "--c1"),
    (f"bifocal solve survey.csv {SOLVE} --json --sigma-s 0", "--sigma-s"),
    (f"bifocal solve survey.csv {SOLVE} --json --sigma-r-max -1", "--sigma-r-max"),
    (f"bifocal solve survey.csv {SOLVE} --json --pitch 0", "--pitch"),
    (f"bifocal solve survey.csv {SOLVE} --json --unit px", "pitch|pixel"),
    (f"bifocal solve survey.csv {SOLVE} --json --unit inch", "--unit"),
    (f"bifocal solve survey.csv {SOLVE} --json --tolerance-rule nonsense", "nonsense"),
    (f"bifocal solve survey.csv {SOLVE} --json --tolerance-rule -2cm", "-2cm|tolerance"),
    (f"bifocal solve survey.csv {SOLVE} --json --tolerance-rule nanmm", "nanmm|tolerance"),
    (f"bifocal solve survey.csv {SOLVE} --json --scale-tolerance -1", "--scale-tolerance"),
    (f"bifocal solve survey.csv {SOLVE} --json --georeference 4D", "--georeference"),
    ("bifocal solve picks.csv --json", "--pair"),
    ("bifocal solve picks.csv --pair wall.pair.json --json --sigma-px -1", "--sigma-px"),
    ("bifocal solve lens.json --json", "lens.json"),
    ("bifocal solve far.jpg --json", "far.jpg"),
    ("bifocal relief wall.pair.json", "--out"),
    ("bifocal relief wall.pair.json --out o.png", "o.png"),
    ("bifocal relief wall.pair.json --out o.tif --gsd 5", "--gsd|gsd|pixel"),
    ("bifocal relief wall.pair.json --out o.tif --gsd 1e-9", "gsd|pixel"),
    ("bifocal relief wall.pair.json --out o.tif --gsd 0", "--gsd"),
    ("bifocal relief wall.pair.json --out o.tif --bounds 5,0,1,1", "bounds|box"),
    ("bifocal relief wall.pair.json --out o.tif --bounds 100,100,101,101", "bounds|common|both"),
    ("bifocal relief wall.pair.json --out o.tif --bounds 0,0,1e9,1e9", "bounds|pixel|px"),
    ("bifocal relief wall.pair.json --out o.tif --quality great", "--quality"),
    ("bifocal relief wall.pair.json --out o.tif --relief-range 1,0", "relief"),
    ("bifocal relief wall.pair.json --out o.tif --relief-range 0,100", "relief"),
    ("bifocal relief wall.pair.json --out o.tif --preview o.bmp", "o.bmp"),
    ("bifocal relief wall.pair.json --out o.tif --preview o.tif", "o.tif"),
    ("bifocal relief wall.pair.json --out o.tif --cloud o.xyz", "o.xyz"),
    ("bifocal ortho wall.pair.json --plane", "--out|--deliver"),
    (f"{ORTHO} --plane --relief relief.tif", "--plane|--relief|one"),
    (f"{ORTHO} --plane 1e10", "plane|camera"),
    (f"{ORTHO} --plane 20", "plane|camera"),
    (f"{ORTHO} --plane --image 3", "--image"),
    (f"{ORTHO} --plane --gsd 1e-9", "gsd|pixel|px"),
    (f"{ORTHO} --plane --bounds 1,1,1,1", "bounds|box|empty"),
    (f"{ORTHO} --plane --bounds 1e9,1e9,2e9,2e9", "bounds|pixel|px"),
    (f"{ORTHO} --plane --interpolation bicubic", "--interpolation"),
    (f"{ORTHO} --plane --vignetting strong", "vignetting"),
    (f"{ORTHO} --plane --vignetting nan,0,0", "vignetting"),
    (f"{ORTHO} --plane --vignetting 1,2", "vignetting"),
    (f"{ORTHO} --plane --feather 1e300", "--feather"),
    (f"{ORTHO} --plane --breakline P1,P2", "--breakline|--points|breakline"),
    (f"{ORTHO} --points result.csv --breakline P1,P99", "P99"),
    (f"{ORTHO} --points result.csv --breakline P1", "P1|breakline"),
    (f"{ORTHO} --points result.csv --breakline P1,P1", "P1|breakline"),
    (f"{ORTHO} --plane --section x=1", "--section|--deliver"),
    (f"{ORTHO} --plane --contours 1", "--contours|--deliver"),
    (ORTHO.replace("o.tif", "o.jpg") + " --plane", "o.jpg"),
    (DELIVER, "--scale"),
    (f"{DELIVER} --scale 1:0", "--scale"),
    (f"{DELIVER} --scale 50:1", "--scale"),
    (f"{DELIVER} --scale 1:50 --dpi 1e300", "--dpi"),
    (f"{DELIVER} --scale 1:50 --dpi 1e9", "dpi|pixel|px"),
    (f"{DELIVER} --scale 1:50 --paper A9", "--paper"),
    (f"{DELIVER} --scale 1:1 --paper A4", "A4|paper"),
    (f"{DELIVER} --scale 1:50 --section x=nan", "section"),
    (f"{DELIVER} --scale 1:50 --section x=", "section"),
    (f"{DELIVER} --scale 1:50 --section z=1", "section"),
    (f"{DELIVER} --scale 1:50 --section x=1000", "section"),
    (f"{DELIVER} --scale 1:50 --section '1,2'", "section"),
    (f"{DELIVER} --scale 1:50 --section '1,2 1,2'", "section"),
    (f"{DELIVER} --scale 1:50 --contours 1e-9", "contour"),
    (f"{DELIVER} --scale 1:50 --mark nothing.csv", "nothing.csv"),
    (f"{DELIVER} --scale 1:50 --control nothing.csv", "nothing.csv"),
    (f"{DELIVER.replace('--deliver d', '--deliver lens.json')} --scale 1:50", "lens.json"),
    ("bifocal mosaic --out o.tif", "ORTHO"),
    ("bifocal mosaic ortho1.tif --out o.png", "o.png|two|at least"),
    ("bifocal mosaic ortho1.tif relief.tif --out o.tif", "relief.tif|ortho1.tif|bands"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out o.tif --gsd 1e-12", "gsd|px|pixel"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out o.tif --gsd 1000", "gsd|px|pixel"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out o.tif --bounds 1,1,0,0", "bounds|box"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out o.tif --bounds 1000,1000,1001,1001", "bounds|box"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out ortho1.tif --overwrite", "ortho1.tif"),
    ("bifocal export result.csv", "--out"),
    ("bifocal export result.csv --out o.shp", "o.shp"),
    ("bifocal export result.csv --out o", "o: "),
    ("bifocal export result.csv --out o.csv --order XYZ", "--order"),
    ("bifocal export result.csv --out o.csv --csv-flavour excel-fr", "--csv-flavour"),
    ("bifocal export result.csv --out o.dxf --world", "control|E, N, H|Georeference"),
    ("bifocal export survey.xlsx --out o.dxf --world", "control|E, N, H|Georeference"),
    ("bifocal export survey.csv --out o.dxf", "survey.csv"),
    ("bifocal export result.csv --out result.csv --overwrite", "result.csv"),
    ("multimedia index --wavelength 5", "wavelength"),
    ("multimedia index --wavelength 1e9", "wavelength"),
    ("multimedia index --temperature 1e9", "temperature"),
    ("multimedia index --temperature -300", "temperature"),
    ("multimedia index --salinity 120", "salinity"),
    ("multimedia index --salinity -1", "salinity"),
    ("multimedia index --depth -1", "depth"),
    ("multimedia index --depth 1e12", "depth"),
    ("multimedia index --formula cauchy", "--formula"),
    ("multimedia index --find salinity", "--from-index"),
    ("multimedia index --from-index 1.34", "--find"),
    ("multimedia index --from-index 0.5 --find salinity", "index"),
    ("multimedia index --from-index 2.5 --find salinity", "index"),
    ("multimedia index --from-index 1.34 --find depth", "--find"),
    ("multimedia index --sigma-wavelength -1", "--sigma-wavelength"),
    ("multimedia template o.xls", "o.xls"),
    ("multimedia template o.xlsx --rows -1", "rows"),
    ("multimedia template o.xlsx --rows 99999999", "rows"),
    ("multimedia template o.xlsx --newton 0", "newton"),
    ("multimedia template o.xlsx --newton 100000", "newton"),
    (SHIFT, "z0|camera|indices"),
    (f"{SHIFT} --z0 1", "indices"),
    (f"{SHIFT} --z0 -1 --indices 1,1.337", "z0"),
    (f"{SHIFT} --z0 1 --indices 1", "indices"),
    (f"{SHIFT} --z0 1 --indices ''", "indices"),
    (f"{SHIFT} --z0 1 --indices 1,0.5e-300", "ind"),
    (f"{SHIFT} --z0 1 --indices 1,99", "index|indices"),
    (f"{SHIFT} --z0 1 --indices 1,1.5,1.337", "thickness"),
    (f"{SHIFT} --z0 1 --indices 1,1.5,1.337 --thicknesses -1", "thickness"),
    (f"{SHIFT} --z0 1 --indices 1,1.5,1.337 --thicknesses 1,2", "thickness"),
    (f"{SHIFT} --z0 1 --camera 0,0,1 --indices 1,1.337", "camera|z0"),
    (f"{SHIFT} --camera 0,0 --indices 1,1.337", "--camera"),
    (f"{SHIFT} --camera 0,0,-5 --indices 1,1.337", "camera"),
    (f"{SHIFT} --z0 1 --indices 1,1.337 --decimal dot", "--decimal"),
    (f"{SHIFT} --z0 1 --indices 1,1.337 --csv excel-fr", "--csv"),
    (f"{SHIFT} --z0 1 --indices 1,1.337 --out o.ods", "o.ods"),
    ("multimedia project tank.toml --out o.pdf", "o.pdf"),
    ("multimedia intersect tank.toml --method best", "--method"),
    ("multimedia intersect tank.toml --out o.txt", "o.txt"),
    ("multimedia intersect tank.toml --points shift.csv", "shift.csv"),
    ("multimedia resect tank.toml --estimate focal", "focal"),
    ("multimedia resect tank.toml --estimate c,c2", "c2"),
    ("multimedia resect tank.toml --camera cam9", "cam9"),
    ("multimedia resect tank.toml --out o.json", "o.json"),
    ("multimedia resect tank.toml --residuals o.pdf", "o.pdf"),
    ("multimedia resect tank.toml --out o.toml --residuals o.toml", "o.toml"),
    (f"{ADJUST} --interior q1", "q1"),
    (f"{ADJUST} --media index9", "index9"),
    (f"{ADJUST} --media nothing:index3", "nothing"),
    (f"{ADJUST} --fix-camera cam9", "cam9"),
    (f"{ADJUST} --control loose", "--control"),
    (f"{ADJUST} --plate nonesuch", "nonesuch"),
    (f"{ADJUST} --scale-bar 1,2", "scale-bar"),
    (f"{ADJUST} --scale-bar 1,2,0.5,-1", "scale-bar|sigma|bar"),
    (f"{ADJUST} --scale-bar 1,2,nan,1", "scale-bar|bar"),
    (f"{ADJUST} --scale-bar 1,99,5,1", "99"),
    (f"{ADJUST} --scale-bar 1,1,5,1", "bar|1"),
    (f"{ADJUST} --prior index3", "prior"),
    (f"{ADJUST} --media index3 --prior index3=nan", "prior|index3"),
    (f"{ADJUST} --media index3 --prior index3=-1", "prior|index3"),
    (f"{ADJUST} --prior nothing=1", "nothing"),
    (f"{ADJUST} --robust 0", "--robust"),
    (f"{ADJUST} --wavelength 520", "--temperature|salinity|index"),
    (f"{ADJUST} --media index3 --wavelength 520 --temperature 500", "temperature"),
    (f"{ADJUST} --report o.pdf", "o.pdf"),
    (f"{ADJUST} --out o.txt", "o.txt"),
    (f"{ADJUST} --out o.toml --report o.toml", "o.toml"),
    (f"{ADJUST} --out tank.toml --overwrite --report tank.toml", "tank.toml"),
    ("multimedia epipolar tank.toml --camera cam1", "--to"),
    ("multimedia epipolar tank.toml --camera cam1 --to cam1", "--to"),
    ("multimedia epipolar tank.toml --camera cam1 --to cam9", "cam9"),
    (f"{CURVE} --point 99", "99"),
    (f"{CURVE} --at 1", "--at"),
    (f"{CURVE} --at 1e14,1e14", "--at"),
    (f"{CURVE} --z-range 1,1", "z-range|depth"),
    (f"{CURVE} --z-range 5000,6000", "z-range|depth|range"),
    (f"{CURVE} --vertices 1", "vert"),
    (f"{CURVE} --vertices 100000000", "vert"),
    (f"{CURVE} --tolerance -1", "--tolerance"),
    (f"{CURVE} --chord 1e-300", "chord"),
    (f"{CURVE} --picture o.txt", "o.txt"),
    (f"{CURVE} --out o.txt", "o.txt"),
    (f"{CURVE} --photo far.jpg", "--picture|photo"),
    (f"{BATHY} --water-level 1", "--index"),
    (f"{BATHY} --index 1.34", "--water-level"),
    (f"{BATHY} --water-level nan --index 1.34", "water level|water-level"),
    (f"{BATHY} --water-level 1e300 --index 1.34", "water level|water-level"),
    (f"{BATHY} --water-level high --index 1.34", "high"),
    (f"{BATHY} --water-level 1 --index 1.0", "--index"),
    (f"{BATHY} --water-level 1 --index 1.5", "--index"),
    (f"{BATHY} --water-level 1 --index 0", "--index"),
    (f"{BATHY} --water-level 1 --index -1.34", "--index"),
    (f"{BATHY} {WATER} --max-angle 0", "--max-angle"),
    (f"{BATHY} {WATER} --max-angle 40", "--max-angle|--cameras"),
    (f"{BATHY} {WATER} --sigma-index -1", "--sigma-index"),
    (f"{BATHY} {WATER} --group-index 1.36", "--group-index|--beams"),
    (f"{BATHY} {WATER} --beams", "X0|beams"),
    (f"{BATHY} {WATER} --rays", "X0|DX|rays"),
    (f"{BATHY} {WATER} --nodata -9999", "--nodata"),
    (f"{BATHY} {WATER} --visibility eyes.csv", "--cameras|visib"),
    (f"{BATHY} --water-level -99 --index 1.34", "under the water|water level"),
    (f"{BATHY} --water-level 1e14 --index 1.34", "water"),
    (f"{LIDAR} {WATER} --group-index 0 --trajectory flight.csv", "--group-index"),
    (f"{LIDAR} {WATER} --group-index 9 --trajectory flight.csv", "group index"),
    (f"{LIDAR} {WATER} --trajectory eyes.csv", "eyes.csv"),
    ("multimedia bathymetry cloud.las --out o.laz --water-level 1 --index 1.34", "o.laz"),
    ("multimedia bathymetry dem.tif --out o.png --water-level 1 --index 1.34", "o.png"),
    ("multimedia bathymetry dem.tif --out o.csv --water-level 1 --index 1.34", "o.csv"),
    ("multimedia bathymetry dem.tif --out dem.tif --overwrite --water-level 1 --index 1.34", "dem"),
    ("multimedia bathymetry far.jpg --out o.tif --water-level 1 --index 1.34", "far.jpg"),
    ("multimedia waterlevel cloud.csv --spread 0", "--spread"),
    ("multimedia waterlevel cloud.csv --out o.txt", "o.txt"),
    ("multimedia waterlevel far.jpg", "far.jpg"),
    ("multimedia waterlevel cloud.csv --out cloud.csv --overwrite", "cloud.csv"),
    ("multimedia openptv far.jpg", "far.jpg"),
    ("multimedia openptv ptv --out o.json", "o.json"),
    ("multimedia openptv ptv --out o.toml --radius 0", "--radius"),
    ("multimedia openptv ptv --out o.toml --min-pixels 0", "--min-pixels"),
    ("multimedia openptv tank.toml --export lens.json", "lens.json"),
    ("multimedia openptv tank.toml --export ptv", "ptv"),
    ("multimedia design", "PROJECT|--distance"),
    ("multimedia design --distance 0.6", "--c|extent|depths"),
    (f"{RING} --cameras 0", "--cameras"),
    (f"{RING} --cameras 1", "camera"),
    (f"{RING} --cameras 1000000", "camera"),
    (f"{RING} --distance 0", "--distance"),
    (f"{RING} --c 1e14", "c|principal|image"),
    (f"{RING} --c 1e-14", "c|principal|image"),
    (f"{RING} --indices 1", "indices"),
    (f"{RING} --indices 1,1.5,1.337", "thickness"),
    (f"{RING} --thicknesses 0.01", "thickness|indices"),
    (f"{RING} --extent 0.3", "--extent"),
    (f"{RING} --extent 0x0", "--extent"),
    (f"{RING} --extent 1e9x1e9", "extent|see|camera|seen"),
    (f"{RING} --depths 0.2x0.02", "depths|depth"),
    (f"{RING} --depths -1x1", "depths|depth"),
    (f"{RING} --depths 1x1", "depths|depth"),
    (f"{RING} --sigma 0", "--sigma"),
    (f"{RING} --sigma 1e14", "sigma"),
    (f"{RING} --seed 1.5", "--seed"),
    (f"{RING} --out o.csv", "o.csv"),
    (f"{RING} --plot o.txt", "o.txt"),
    ("multimedia design tank.toml --distance 1", "PROJECT"),
]


def edited(name: str, *path: object, value: object) -> Callable[[Path], str]:
    """Return what makes a JSON file with one value exchanged, or taken out (...)."""

    def make(folder: Path) -> str:
        data = json.loads((folder / name).read_text())
        place = data
        for key in path[:-1]:
            place = place[key]
        if value is ...:
            del place[path[-1]]
        else:
            place[path[-1]] = value
        return json.dumps(data)

    return make


def swapped(name: str, old: str, new: str) -> Callable[[Path], str]:
    """Return what makes a text file with one passage exchanged."""

    def make(folder: Path) -> str:
        text = (folder / name).read_text()
        assert old in text, (name, old)
        return text.replace(old, new, 1)

    return make


def row(name: str, line: str) -> Callable[[Path], str]:
    """Return what makes a text file with one more line."""
    return lambda folder: (folder / name).read_text() + line + "\n"


DEEP = "[" * 100_000
BIG = 10**400
NAN, INF = float("nan"), float("inf")
PAIR_LINE = "bifocal solve picks.csv --pair wall.pair.json --json"
LENS_LINE = "bifocal undistort far.jpg --lens lens.json"
SOLVE_LINE = f"bifocal solve survey.csv {SOLVE} --json"
TANK_LINE = "multimedia project tank.toml --json"
CLOUD_LINE = f"multimedia bathymetry cloud.csv --out o.csv {WATER}"
PLY_LINE = f"multimedia bathymetry cloud.ply --out o.ply {WATER}"

_PAIR: list[tuple[tuple[object, ...], object, str]] = [
    (("format",), "bifocal-pair/9", "format"), (("format",), 5, "format"),
    (("image1",), ..., "image1"), (("image1",), [], "image1"), (("image1",), "far.jpg", "image1"),
    (("image2",), None, "image2"),
    *(
        (("image1", "distance"), value, "distance")
        for value in (
            ..., None, "17.5", True, [], [17.5], {}, 0, -3, NAN, INF, 1e300, 1e30, BIG, 9.5, "abc",
        )
    ),
    *(
        (("image2", "nadir"), value, "nadir")
        for value in (..., 3, "0,0", [0], [0, 0, 0], [0, NAN], [0, "x"], [[0, 0]], [True, False],
                      [0, 1e300])
    ),
    *(
        (("image1", "plane_from_pixel"), value, "plane_from_pixel")
        for value in (..., 3, "I", [], [[1, 0, 0], [0, 1, 0]], [[0] * 3] * 3, [[NAN] * 3] * 3,
                      [[1, 0, 0], [0, 1, 0], [0, 0, "1"]], [[1, 0], [0, 1, 0], [0, 0, 1]],
                      [[1e300, 0, 0], [0, 1e300, 0], [0, 0, 1]])
    ),
    *((("image1", "principal_distance"), value, "principal_distance") for value in
      ("abc", -1, 0, [], True, 1e300)),
    *((("image1", "pixel_size"), value, "pixel_size") for value in ("abc", -1, [], True)),
    *((("image1", "sigma_pixel"), value, "sigma_pixel") for value in
      ("x", -1, 0, [], True, 1e300)),
    *((("layers",), value, "layers|indices|thick") for value in
      (3, {"indices": [1]}, {"indices": [1, "n"], "thicknesses": []},
       {"indices": [1, 1.5, 1.3], "thicknesses": []}, {"indices": [1, -1], "thicknesses": []})),
    (("image1", "lens"), 3, "lens"), (("image1", "lens"), "nowhere.json", "nowhere.json"),
    (("image1", "file"), 3, "file"),
]  # fmt: skip
_LENS: list[tuple[tuple[object, ...], object, str]] = [
    *(
        (("image_size",), value, "image_size|240 x 160")
        for value in (..., "ab", ["a", "b"], [240], [240.7, 160], [0, 160], [NAN, 160], [BIG, 1],
                      [1e300, 1], {}, None, [True, True], 5)
    ),
    *(
        (("camera_matrix",), value, "camera_matrix|principal distance")
        for value in (..., 3, "x", [], [[0] * 3] * 3, [[NAN] * 3] * 3, {},
                      [[-350, 0, 120], [0, 350, 80], [0, 0, 1]], [[350, 0, 120], [0, 350, 80]],
                      [[350, 0, 120], [0, 350, 80], [0, 0, 0]])
    ),
    *((("coefficients",), value, "coefficients") for value in
      (..., "x", [1], [NAN] * 5, ["a"] * 5, {}, None, [[1, 2], 3], [True] * 5, [1e300] * 5)),
    *((("model",), value, "model") for value in ("brown", 5, {}, [], None)),
    *((("sigma0",), value, "sigma0") for value in ("x", -1, [1, 2], True)),
]  # fmt: skip
_TANK: list[tuple[str, str, str]] = [
    ('format = "multimedia-project/1"', 'format = "multimedia-project/7"', "format"),
    ('format = "multimedia-project/1"', "format = 3", "format"),
    ('unit = "mm"', 'unit = "yard"', "unit"), ('unit = "mm"', "unit = 5", "unit"),
    ('unit = "mm"', 'unit = ', "tank.toml"),
    *(("sigma_image = 0.001", f"sigma_image = {value}", "sigma_image")
      for value in ('"x"', "-1", "nan", "inf", "[]", "true", "0")),
    *(("c = 25.0", f"c = {value}", "c:|cam1")
      for value in ('"x"', "-1", "nan", "inf", "[]", "true", "0", "1e300", "9" * 400)),
    *(("omega = -0", f"omega = {value} # ", "omega|angle|cam1")
      for value in ('"x"', "nan", "inf", "[]", "true", "1e300", "1979-05-27")),
    ("indices = [\n    1.0", 'indices = [\n    "a"', "indices"),
    ("indices = [\n    1.0", "indices = [\n    nan", "ind"),
    ("indices = [\n    1.0", "indices = [\n    -1.0", "ind"),
    ("indices = [\n    1.0", "indices = [\n    [1.0]", "ind"),
    ("indices = [\n    1.0,", "indices = [", "thickness|indices"),
    ("    10.0,", "    -10.0,", "thick"), ("    10.0,", "    nan,", "thick"),
    ("    10.0,", '    "x",', "thick"),
    ("normal = [\n    0.0,\n    0.0,\n    1.0", "normal = [\n    0.0,\n    0.0,\n    0.0", "normal"),
    ("normal = [\n    0.0,", "normal = [", "normal"),
    ("    820.0,", "    1e300,", "centre|cam1"), ("    820.0,", "    nan,", "centre|cam1"),
    ("    820.0,", "", "centre"), ("    820.0,", "    [820.0],", "centre"),
    ('media = "tank"', 'media = "glass"', "glass"), ('media = "tank"', "media = 3", "media"),
    ('name = "cam1"', 'name = "cam2"', "cam2"), ('name = "cam1"', "name = 1", "cam1"),

    ("[media.tank]", "[media]", "tank|media"),
    ("[[camera]]", "[camera]", "camera|tank.toml"),
    ("k1 = 2e-05", 'k1 = "x"', "k1"), ("k1 = 2e-05", "k1 = nan", "k1"),
    ("k1 = 2e-05", "k1 = 1e300", "k1|distort"), ("k1 = 2e-05", "k9 = 1.0", "k9"),
    ('convention = "openptv"', 'convention = "other"', "convention"),
    ("width = 1280", "width = -5", "width"), ("width = 1280", "width = 12.5", "width"),
    ("width = 1280", 'width = "x"', "width"), ("width = 1280", f"width = {BIG}", "width"),
    ("    0.012,", "    0.0,", "pitch"), ("    0.012,", "    nan,", "pitch"),
    ('"tank_object_points.csv"', '"nowhere.csv"', "nowhere.csv"),
    ('"tank_object_points.csv"', '"' + 300 * "n" + '.csv"', "nnn"),
    ('"tank_object_points.csv"', "5", "object_points"),
    ('"tank_object_points.csv"', '"a\\u0000b.csv"', "tank.toml|object_points"),
    ('"tank_object_points.csv"', "[]", "object_points"),
    ("[media.tank]", f"x = {DEEP}", "tank.toml"),
    ("[media.tank]", "\x01", "tank.toml"),
]  # fmt: skip


def _cell(value: str) -> Callable[[Path], str]:
    """Return the picks with one y2 exchanged, after the last comma of the file."""
    return lambda folder: (folder / "survey.csv").read_text().rpartition(",")[0] + f",{value}\n"


def _shift_cell(value: str) -> Callable[[Path], str]:
    return lambda folder: (folder / "shift.csv").read_text().rpartition(",")[0] + f",{value}\n"


PLY = "ply\nformat ascii 1.0\nelement vertex 3\n{}end_header\n{}"
XYZ = "property float x\nproperty float y\nproperty float z\n"

#: A line, the file that is exchanged, what it holds then, and what the refusal must name.
CONTENTS: list[tuple[str, str, Any, str]] = [
    *((PAIR_LINE, "wall.pair.json", edited("wall.pair.json", *path, value=value), culprit)
      for path, value, culprit in _PAIR),
    *((PAIR_LINE, "wall.pair.json", text, "wall.pair.json") for text in (
        "[1]", "3", "null", '"x"', "{", "{}", '{"format": 1e999}', '{"a": ' + DEEP, "{\x00}",
        '{"a": ' + "9" * 5000 + "}", "\ufeff\ufeff{}",
    )),
    *((LENS_LINE, "lens.json", edited("lens.json", *path, value=value), culprit)
      for path, value, culprit in _LENS),
    *((TANK_LINE, "tank.toml", swapped("tank.toml", old, new), culprit)
      for old, new, culprit in _TANK),
    *((SOLVE_LINE, "survey.csv", _cell(value), "survey.csv.*(y2|P11|F13)") for value in (
        "abc", "12,4 cm", "12.4 cm x", "nan", "inf", "1e300", "1e400", "#REF!", "=1+1", "--3",
        "1.2.3", "0x10", "12:30", "1 2 3", "TRUE", "½",
    )),
    (SOLVE_LINE, "survey.csv", row("survey.csv", "P0,1,2,3,4"), "P0"),
    (SOLVE_LINE, "survey.csv", row("survey.csv", "Q,1,,3,4"), "Q|y1"),
    (SOLVE_LINE, "survey.csv", row("survey.csv", 'Q,"1'), "survey.csv"),
    (SOLVE_LINE, "survey.csv", "id,x1 [mm],y1 [mm],x2 [mm],y2 [mm]\n", "survey.csv"),
    (SOLVE_LINE, "survey.csv", "a,b,c\n1,2,3\n", "survey.csv"),
    (SOLVE_LINE, "survey.csv", swapped("survey.csv", "y1 [mm]", "x1 [mm]"), "x1|y1"),
    (SOLVE_LINE, "survey.csv", "\0" * 10, "survey.csv"),
    (SOLVE_LINE, "survey.csv", "id;" * 2_000, "survey.csv"),
    *((f"{SHIFT} --z0 1 --indices 1,1.337", "shift.csv", _shift_cell(value), "shift.csv.*Z|C")
      for value in ("abc", "inf", "1e300", "0.3 km/h", "#DIV/0!")),
    *((TANK_LINE, "tank_object_points.csv", text, "tank_object_points.csv") for text in (
        "id,X,Y\n1,2,3\n", "id,X,Y,Z\n1,2,3,x\n", "id,X,Y,Z\n1,2,3,inf\n",
        "id,X,Y,Z\n1,2,3,4\n1,2,3,5\n", "",
    )),
    *(("multimedia intersect tank.toml --json", "tank_image_points.csv", text,
       "tank_image_points.csv") for text in (
        "camera,id,col,row\ncam9,1,2,3\n", "camera,id,col,row\ncam1,1,2,x\n",
        "camera,id,col,row\ncam1,1,2,inf\n", "camera,id,col,row\ncam1,1,1e300,3\n",
        "a,b\n1,2\n",
    )),
    *((CLOUD_LINE, "cloud.csv", text, "cloud.csv") for text in (
        "X,Y\n1,2\n", "X,Y,Z\n1,2,x\n", "X,Y,Z\n", "X [mm],Y [mm],Z [mm]\n1,2,3\n",
        "X,Y,Z\n" + "1,2,-9999\n" * 20 + "1,2,-3\n" * 20, "X,Y,Z\n1,2,inf\n", "X,Y,Z\n1,2,-1e300\n",
        "X,Y,Z\n1,inf,-1\n", b"X,Y,Z\n1,2,\xff\xfe\x00\n",
    )),
    *((PLY_LINE, "cloud.ply", text, "cloud.ply") for text in (
        "ply\n", "ply\nformat\n", "ply\nformat ascii 2.0\n", PLY.format("", ""),
        PLY.format("property float x\n", "1\n2\n3\n"), PLY.format(XYZ, "1 2 3\n"),
        PLY.format(XYZ, "1 2 x\n" * 3), PLY.format(XYZ, "1 2 inf\n" * 3),
        PLY.format(XYZ, "1 2 -1e30\n" * 3), PLY.format(XYZ, "1 2\n" * 3),
        PLY.format(XYZ, "").replace("vertex 3", "vertex -3"),
        PLY.format(XYZ, "").replace("vertex 3", "vertex 99999999999999999999"),
        PLY.format(XYZ, "").replace("vertex 3", "vertex"),
        PLY.format("property\n", ""), PLY.format("property float\n", ""),
        PLY.format("property quaternion x\n", ""), PLY.format("property list uchar int x\n", ""),
        PLY.format(XYZ + XYZ, "1 2 3\n" * 3), PLY.format(XYZ, "").replace("end_header\n", ""),
        PLY.format(XYZ, "").replace("ascii", "binary_little_endian"),
        PLY.format(XYZ, "").replace("ascii", "binary_middle_endian"),
    )),
    *((f"multimedia bathymetry cloud.csv --out o.csv {WATER} --cameras eyes.csv", "eyes.csv", text,
       "eyes.csv|A|camera") for text in (
        "id,X,Y\nA,1,2\n", "id,X,Y,Z\nA,1,2,inf\n", "id,X,Y,Z\nA,1,2,-50\n", "id,X,Y,Z\nA,1,2,1e300\n",
        "id,X,Y,Z\nA,1,2,30\nA,1,2,31\n", "id,X,Y,Z\n",
    )),
    *((f"{LIDAR} {WATER} --trajectory flight.csv", "flight.csv", text, "flight.csv|time")
      for text in ("time,X,Y,Z\n0,0,0,50\n", "time,X,Y,Z\n9,0,0,50\n0,0,0,50\n",
                   "time,X,Y,Z\n0,0,0,50\n1,0,0,50\n", "time,X,Y,Z\n0,0,0,50\n0,0,0,50\n")),
    *((f"multimedia bathymetry rays.csv --rays --out o.csv {WATER}", "rays.csv", text,
       "rays.csv|ray|A") for text in (
        "id,X0,Y0,Z0,DX,DY\nA,0,0,30,0,0\n", "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,30,0,0,0\n",
        "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,30,0,0,1\nA,1,0,30,0,0,1\n",
        "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,30,0,0,inf\n",
        "id,X0,Y0,Z0,DX,DY,DZ\nA,0,0,-30,0,0,-1\nA,1,0,-30,0,0,-1\n",
    )),
    *(("multimedia bathymetry cloud.csv --out o.csv --index 1.34 --water-level water.json",
       "water.json", text, "water.json|level|slope|normal") for text in (
        "{}", "[]", '{"level": "x", "slope": [0, 0], "centre": [0, 0]}',
        '{"level": NaN, "slope": [0, 0], "centre": [0, 0]}',
        '{"level": 1e300, "slope": [0, 0], "centre": [0, 0]}',
        '{"level": 1, "slope": [0], "centre": [0, 0]}',
        '{"level": 1, "slope": [1e300, 0], "centre": [0, 0]}',
        '{"level": true, "slope": [0, 0], "centre": [0, 0]}',
        '{"level": ' + str(BIG) + ', "slope": [0, 0], "centre": [0, 0]}',
    )),
    *((f"{ALIGN} --control control.csv", "control.csv", text, "control.csv|P0|control|scale") for text in (
        "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\nP0,0,0,1,1,1,1\n",
        "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\n"
        + "".join(f"P{k},{k},0,{k},1,{k},1\n" for k in range(5)),
        "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\nP0,inf,0,1,1,1,1\n",
        "id,X [m],Y [m],col1 [px],row1 [px],col2 [px],row2 [px]\nP0,0,0,9999,1,1,1\n",
    )),
    (f"{ALIGN} --control control.csv", "control.csv", row("control.csv", "P0,0,0,0,1,1,1,1"), "P0"),
    (LINES, "lines.csv", "line,col [px],row [px]\n1,2,3\n", "lines.csv"),
    (LINES, "lines.csv", "line,col [px],row [px]\n1,2,inf\n", "lines.csv"),
    (LINES, "lines.csv", "line,col [px],row [px]\n" + "1,2,3\n2,2,3\n3,3,3\n" * 4, "lines.csv|line"),
    *(("bifocal export result.csv --out o" + ending, "result.csv",
       lambda folder: (folder / "result.csv").read_text() + "Q,1e300,0,1e300,1e300\n",
       "result.csv|Q") for ending in (".dxf", ".ply", ".las", ".csv", ".geojson", ".xlsx")),
    *(("bifocal export result.csv --out o.dxf", "result.csv", text, "result.csv") for text in (
        "id,X [m],Y [m],r [m]\n", "id,X [m]\nA,1\n", "id,X [m],Y [m],r [m]\nA,x,2,3\n",
        "id,X [m],Y [m],r [m]\nA,inf,2,3\n",
    )),
    *(("multimedia openptv ptv --out o.toml", "ptv/" + name, text, "cam1|ptv.par|calblock|ptv")
      for name, text in (
        ("parameters/ptv.par", ""), ("parameters/ptv.par", "x\n" * 30),
        ("parameters/ptv.par", "9999999999\n" * 30), ("parameters/ptv.par", "nan\n" * 30),
        ("cal/cam1.tif.ori", ""), ("cal/cam1.tif.ori", "nan " * 30), ("cal/cam1.tif.ori", "x " * 30),
        ("cal/cam1.tif.ori", "0 " * 30), ("cal/cam1.tif.ori", "1e300 " * 30),
        ("cal/cam1.tif.addpar", "x"), ("cal/cam1.tif.addpar", "nan " * 7),
        ("cal/cam1.tif.addpar", "1"), ("cal/cam1.tif.addpar", "1e300 " * 7),
        ("cal/cam1.tif_targets", ""), ("cal/cam1.tif_targets", "3\n1 2\n"),
        ("cal/cam1.tif_targets", "-3\n"), ("cal/cam1.tif_targets", "x\n"),
        ("cal/cam1.tif_targets", "9" * 5000), ("cal/cam1.tif_targets", "1\n0 nan nan 1 1 1 1 0\n"),
        ("cal/calblock.txt", ""), ("cal/calblock.txt", "1 2 3\n"), ("cal/calblock.txt", "1 x y z\n"),
        ("cal/calblock.txt", "1 nan 0 0\n"), ("cal/calblock.txt", "1 1e300 0 0\n2 1 1 1\n"),
      )),
    *(("bifocal undistort far.jpg --lens cameras.txt", "cameras.txt", text, "cameras.txt") for text in (
        "1 PINHOLE 240 160 0 0 120 80\n", "1 PINHOLE 240 160 x 350 120 80\n",
        "1 PINHOLE 240 160 nan nan 120 80\n", "1 PINHOLE 240 160\n", "1 SUPERLENS 240 160 1 2 3\n",
        "# only a comment\n", "1 OPENCV 240 160 350 350 120 80 inf 0 0 0\n",
    )),
    *(("bifocal undistort far.jpg --lens lens.xml", "lens.xml", text, "lens.xml") for text in (
        "<x/>", "<calibration>", "<calibration><f>0</f></calibration>", "not xml",
        '<!DOCTYPE a [<!ENTITY b "c">]><calibration>&b;</calibration>',
        "<calibration><projection>frame</projection><width>240</width><height>160</height>"
        "<f>nan</f></calibration>",
        '<!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
        "]><calibration>&b;</calibration>",
    )),
    *(("bifocal undistort far.jpg --lens lens.yml", "lens.yml", text, "lens.yml") for text in (
        "%YAML:1.0\n", "%YAML:1.0\n---\ncamera_matrix: 3\n", "a: [" * 2000,
        "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [ .Nan, 0., 1., 0., 1., 1., 0., 0., 1. ]\n",
    )),
]
