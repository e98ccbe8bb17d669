"""Each line of the page on control points, run on a file as the program writes it."""

from __future__ import annotations

import contextlib
import json
import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from tests.bifocal.campaigns.test_rectification import CAMERA, DOTS, SIZE, seen
from tests.builders.commands import bifocal_command
from tests.tables import each

PAGE = Path("docs/control-points.md").read_text(encoding="utf-8")
LINES = re.findall(r"^\| ([^|]+) \| [^|]+ \| `(bifocal [^`]+)` \|$", PAGE, re.M)
#: X along the wall in azimuth 40 degrees from here. [m]
PLACE, ALONG = np.array([652345.0, 6862123.0, 250.0]), np.deg2rad(40.0)
PIXELS = seen(DOTS)
WORLD = PLACE + np.column_stack(
    [DOTS[:, 0] * np.sin(ALONG), DOTS[:, 0] * np.cos(ALONG), DOTS[:, 1]]
)
FLAT = np.column_stack([DOTS, np.zeros(len(DOTS))])


def lines(rows, start="", mark=","):
    return start + "".join(mark.join(map(str, row)) + "\n" for row in rows)


def table(headings, places):
    return lines([(f"P{k}", *(f"{v:.5f}" for v in (*place, *at)))
                  for k, (place, at) in enumerate(zip(places, PIXELS, strict=True))],
                 f"{headings},col,row\n")  # fmt: skip


def markers():
    marker = "".join(
        f'<marker id="{k}" label="P{k}"><reference x="{e}" y="{n}" z="{h}"/></marker>'
        for k, (e, n, h) in enumerate(WORLD)
    )
    # From the corner of the first pixel, as Metashape counts.
    shown = "".join(
        f'<marker marker_id="{k}"><location camera_id="0" x="{c + 0.5}" y="{r + 0.5}"/></marker>'
        for k, (c, r) in enumerate(PIXELS)
    )
    return (
        f'<document><chunk><cameras><camera id="0" label="far.JPG"/></cameras><markers>{marker}'
        f"</markers><frames><frame><markers>{shown}</markers></frame></frames></chunk></document>"
    )


def geojson():
    features = [
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": place.tolist()},
         "properties": {"name": f"P{k}", "col": at[0], "row": at[1]}}
        for k, (place, at) in enumerate(zip(FLAT, PIXELS, strict=True))
    ]  # fmt: skip
    return json.dumps({"type": "FeatureCollection", "features": features})


def long():
    rows = [(f"P{k}", photo, *place, *at)
            for k, (place, at) in enumerate(zip(FLAT, PIXELS, strict=True))
            for photo in ("far.JPG", "IMG_9.JPG")]  # fmt: skip
    return lines(rows, "id,photo,X,Y,r,col,row\n")


FILES = {
    "points.csv": table("id,X,Y,r", FLAT),
    "station.csv": table("Punkt,E,N,H", WORLD),
    "geodetic.csv": table("Punkt,Y,X,H", WORLD),
    "feet.csv": table("Point,Easting [ftUS],Northing [ftUS],Elevation [ftUS]", WORLD * 3937 / 1200),
    "pnez.txt": lines([(k + 1, n, e, h, *at)
                       for k, ((e, n, h), at) in enumerate(zip(WORLD, PIXELS, strict=True))]),
    "gcp_list.txt": lines([(*place, *at, "far.jpg", f"P{k}")
                           for k, (place, at) in enumerate(zip(WORLD, PIXELS, strict=True))],
                          "EPSG:2154\n", " "),
    "far.points": lines([(*xy, c + 0.5, -r - 0.5, 1, 0, 0, 0)
                         for xy, (c, r) in zip(DOTS, PIXELS, strict=True)],
                        "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n"),
    "markers.xml": markers(),
    "long.csv": long(),
    "points.geojson": geojson(),
}  # fmt: skip


def test_the_page_has_a_line_for_each_file_and_none_besides():
    named = [re.search(r"--control (\S+)", command)[1] for _, command in LINES]
    assert sorted(named) == sorted(FILES)


@each(("program", "command"), LINES)
def test_a_line_gives_the_camera_that_took_the_photo(program, command, tmp_path_factory):
    folder = tmp_path_factory.mktemp("control")
    cv2.imwrite(str(folder / "far.jpg"), np.zeros(SIZE[::-1], np.uint8))
    name = re.search(r"--control (\S+)", command)[1]
    (folder / name).write_text(FILES[name], encoding="utf-8")
    lens = ("--focal", f"{1500 * 36 / SIZE[0]:.6f}", "--sensor-width", "36", "--gsd", "0.2")
    with contextlib.chdir(folder):
        done = CliRunner().invoke(bifocal_command, [*shlex.split(command)[1:], *lens, "--json"])
    assert done.exit_code == 0, (program, done.stderr)
    result = json.loads(done.stdout)
    assert result["distance"] == pytest.approx(CAMERA.centre[2], rel=0.005)
    assert len(result["left_out"]) == len(DOTS), program
    assert max(abs(np.array([one["error"] for one in result["left_out"]])).ravel()) < 0.002
