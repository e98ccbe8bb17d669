"""Command lines with a place where a file goes in or out."""

from __future__ import annotations

SOLVE = "--d1 17.5 --d2 9.5 --c1 35 --c2 19"
WATER = "--water-level 1 --index 1.34"
CURVE = "multimedia epipolar tank.toml --camera cam1 --to cam2"
BOARDS = "cam1_1.png cam1_2.png cam1_3.png"
RING = "multimedia design --distance 0.6 --c 25 --extent 0.3x0.3 --depths 0.02x0.2"
CANON = "bifocal plan --focal 35 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048"
ALIGN = "bifocal align far.jpg near.jpg --focal1 35 --focal2 19 --sensor-width 22.7 --out o.json"
SITE = "--distance1 17.5 --distance2 9.5"
FACADE = (
    f"bifocal facade far.jpg near.jpg {SITE} --focal1 35 --focal2 19 --sensor-width 22.7 "
    "--scale 1:100 --out d"
)

SET = "o.photos.json"
PHOTOS = f"bifocal photos {{}} --points project.csv --images project --out {SET}"

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
    ("bifocal match {} --out o.csv", "wall.photos.json"),
    ("bifocal solve {} --out o.xlsx", "survey.xlsx"),
    ("bifocal solve {} --json " + SOLVE, "survey.ods"),
    ("bifocal solve {} --json " + SOLVE, "survey.csv", "half"),
    ("bifocal solve picks.csv --json --pair {}", "wall.pair.json"),
    ("bifocal solve picks.csv --json --pair {}", "wall.photos.json"),
    ("bifocal solve {} --json --pair wall.photos.json", "picks3.csv", "half"),
    ("bifocal relief {} --out o.tif", "wall.pair.json"),
    ("bifocal relief {} --out o.tif", "wall.photos.json"),
    ("bifocal adjust {} wall.pair.json --out d", "wall.pair.json"),
    ("bifocal ortho {} --plane --out o.tif", "wall.pair.json"),
    ("bifocal ortho {} --plane --out o.tif", "wall.photos.json"),
    ("bifocal ortho wall.pair.json --out o.tif --relief {}", "relief.tif"),
    ("bifocal ortho wall.pair.json --out o.tif --points {}", "result.csv", "half"),
    ("bifocal rectify {} --control control.csv --out o.tif", "far.jpg", "photo"),
    ("bifocal rectify far.jpg --out o.tif --control {}", "control.csv", "half"),
    ("bifocal rectify far.jpg --out o.tif --control control.csv --lens {}", "lens.json"),
    ("bifocal mosaic {} ortho2.tif --out o.tif", "ortho1.tif"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out o.tif --relief {}", "relief.tif"),
    ("bifocal view {} --out o.html", "relief.tif"),
    ("bifocal compare {} relief2.tif --out d", "relief.tif"),
    ("bifocal compare relief2.tif {} --out d", "relief.tif"),
    ("bifocal compare relief.tif relief2.tif --out d --stable {}", "still.geojson"),
    ("bifocal view relief.tif --out o.html --ortho {}", "ortho1.tif"),
    (FACADE.replace("far.jpg", "{}"), "far.jpg", "photo"),
    (FACADE + " --control {}", "control.csv", "half"),
    (FACADE + " --check {}", "control.csv", "half"),
    (FACADE + " --lens {}", "lens.json"),
    ("bifocal survey {} --dry-run", "street.toml"),
    ("bifocal report {} --out o.html", "wall.pair.json"),
    ("bifocal report {} --out o.html", "survey.xlsx"),
    ("bifocal report wall.pair.json --out o.html --relief {}", "relief.tif"),
    ("bifocal pick {}", "wall.pair.json", "folder"),
    ("multimedia targets {} --out o.csv", "far.jpg", "photo"),
    (
        "multimedia particles {} --targets t --targets t --targets t --targets t --out o.csv",
        "tank.toml",
    ),
    (
        "multimedia particles tank.toml --targets {} --targets t --targets t --targets t "
        "--out o.csv",
        "ptv",
    ),
    (f"{PHOTOS} --wall A,B,C", "project/cameras.xml"),
    (PHOTOS, "project/reconstruction.json"),
    (PHOTOS, "project/cameras.sfm"),
    (PHOTOS, "project/bundle.out"),
    (
        f"bifocal photos project/text --points {{}} --length A,B,3 --out {SET}",
        "project.csv",
        "half",
    ),
    (
        f"bifocal photos project/text --points project.csv --control {{}} --out {SET}",
        "corners.csv",
        "half",
    ),
    (f"bifocal photos project/text --cloud {{}} --out {SET}", "cloud.ply"),
    ("bifocal photos {} --to colmap --out d", "wall.pair.json"),
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
    ("multimedia boards {} far.jpg --board 9x6 --square 1 --out o.toml", "tank.toml"),
    ("multimedia boards tank.toml {} --board 9x6 --square 1 --out o.toml", "far.jpg", "photo"),
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
    ("multimedia bathymetry cloud.csv --out o.csv --index 1.34 --water-level {}", "mesh.obj"),
    (f"multimedia bathymetry cloud.csv --out o.csv {WATER} --cameras {{}}", "eyes.csv", "half"),
    (f"multimedia bathymetry cloud.csv --out o.csv {WATER} --cameras {{}}", "tank.toml"),
    (
        f"multimedia bathymetry cloud.las --out o.las {WATER} --trajectory {{}}",
        "flight.csv",
    ),
    (f"multimedia bathymetry {{}} --rays --out o.csv {WATER}", "rays.csv", "half"),
    ("multimedia soundings {} cloud.csv --water-level 1", "dem.tif"),
    ("multimedia soundings dem.tif {} --water-level 1", "cloud.csv", "half"),
    ("multimedia waterlevel {} --out o.json", "cloud.csv", "half"),
    ("multimedia waterlevel {} --out o.json", "cloud.ply"),
    ("multimedia openptv {} --out o.toml", "ptv", "half"),
    ("multimedia openptv {} --export o", "tank.toml"),
    ("multimedia convert {} o.toml", "lens.yml"),
    ("multimedia convert {} o.xml", "tank.toml"),
    ("multimedia design {} --json", "tank.toml"),
]

#: A line with {} where a file is written, the ending it has, and the places that are no fault.
OUTPUTS: list[tuple[str, ...]] = [
    ("bifocal template {}", ".xlsx"),
    (f"{CANON} --scale 500 --out {{}}", ".xlsx"),
    ("bifocal calibrate far.jpg --lines lines.csv --out {}", ".json"),
    (ALIGN.replace("o.json", "{}") + " --control control.csv", ".json"),
    (ALIGN + " --control control.csv --picture {}", ".png"),
    (f"{PHOTOS.replace('{}', 'project/text').replace(SET, '{}')}", ".photos.json"),
    ("bifocal photos wall.pair.json --to colmap --out {}", "", "folder", "no folder"),
    ("bifocal match wall.pair.json --out {}", ".xlsx"),
    ("bifocal match wall.pair.json --out {}", ".csv"),
    (f"bifocal solve survey.csv {SOLVE} --out {{}}", ".xlsx"),
    (f"bifocal solve survey.csv {SOLVE} --out {{}}", ".csv"),
    ("bifocal relief wall.pair.json --out {}", ".tif"),
    ("bifocal relief wall.photos.json --out {}", ".tif"),
    ("bifocal relief wall.pair.json --out o1.tif --preview {}", ".png"),
    ("bifocal relief wall.pair.json --out o1.tif --cloud {}", ".ply"),
    ("bifocal ortho wall.pair.json --plane --out {}", ".tif"),
    ("bifocal rectify far.jpg --control control.csv --out {}", ".tif"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out {}", ".tif"),
    *(
        ("bifocal export result.csv --out {}", e)
        for e in (
            ".dxf",
            ".ply",
            ".las",
            ".laz",
            ".csv",
            ".geojson",
            ".xlsx",
        )
    ),
    ("bifocal view relief.tif --out {}", ".html"),
    ("bifocal report wall.pair.json --out {}", ".html"),
    ("bifocal report wall.pair.json --out {}", ".pdf"),
    ("multimedia template {}", ".xlsx"),
    ("multimedia shift shift.csv --z0 1 --indices 1,1.337 --out {}", ".csv"),
    ("multimedia shift shift.csv --z0 1 --indices 1,1.337 --out {}", ".xlsx"),
    ("multimedia project tank.toml --out {}", ".csv"),
    ("multimedia intersect tank.toml --out {}", ".xlsx"),
    ("multimedia resect tank.toml --out {}", ".toml"),
    ("multimedia resect tank.toml --residuals {}", ".csv"),
    ("multimedia adjust tank.toml --out {}", ".toml"),
    (f"multimedia boards tank.toml {BOARDS} --board 9x6 --square 5 --out {{}}", ".toml"),
    ("multimedia adjust tank.toml --report {}", ".html"),
    (CURVE + " --out {}", ".csv"),
    (CURVE + " --picture {}", ".png"),
    (f"multimedia bathymetry dem.tif {WATER} --out {{}}", ".tif"),
    *(
        (f"multimedia bathymetry cloud{e} {WATER} --out {{}}", e)
        for e in (
            ".csv",
            ".ply",
            ".las",
            ".laz",
        )
    ),
    ("multimedia soundings dem.tif cloud.csv --water-level 1 --out {}", ".csv"),
    ("multimedia waterlevel cloud.csv --out {}", ".json"),
    ("multimedia openptv ptv --out {}", ".toml"),
    ("multimedia convert lens.yml {}", ".toml"),
    ("multimedia convert tank.toml {}", ".xml"),
    ("multimedia design tank.toml --out {}", ".xlsx"),
    ("multimedia design tank.toml --plot {}", ".png"),
    ("multimedia design tank.toml --plot {}", ".pdf"),
    (CURVE + " --picture {}", ".pdf"),
]
