"""Lists with a row a photo where only the places are wanted: each point once, if its rows agree."""

from pathlib import Path

import numpy as np
import pytest

from bifocal.orientation.control_points import read_control
from bifocal.projects.project_points import COLUMNS, read_points
from bifocal.projects.scale import by_control
from multimedia.bathymetry.survey_tables import read_camera_positions
from multimedia.projects.point_tables import _IMAGE, read_object_points
from photocore.errors import WorkbookError
from photocore.provenance import noted_remarks, recording
from photocore.tables import read_table

PLACES = {"P1": (10.0, 20.0, 5.0), "P2": (14.0, 20.0, 5.5), "P3": (14.0, 23.0, 6.0)}
XML = (
    "<document><chunk><markers>{}</markers><frames><frame><markers>{}</markers>"
    "</frame></frames></chunk></document>"
)


def gcp_list(places):
    rows = [f"{x} {y} {z} {k}10 20 IMG_{k}.JPG {n}" for n, x, y, z in places for k in "123"]
    return "gcp_list.txt", "EPSG:25832\n" + "\n".join(rows) + "\n"


def markers_csv(places):
    rows = [f"{n},{x},{y},{z},{k}.5,7.5,IMG_{k}.JPG" for n, x, y, z in places for k in "12"]
    return "markers.csv", "#Label,X/Easting,Y/Northing,Z/Altitude,px,py,image\n" + "\n".join(rows)


def markers_xml(places):
    known = [
        f'<marker id="{k}" label="{n}"><reference x="{x}" y="{y}" z="{z}"/></marker>'
        for k, (n, x, y, z) in enumerate(places)
    ]
    spots = '<location camera_id="0" x="1" y="2"/><location camera_id="1" x="1" y="2"/>'
    shown = [f'<marker marker_id="{k}">{spots}</marker>' for k in range(len(places))]
    return "markers.xml", XML.format("".join(known), "".join(shown))


READERS = {
    "object points": lambda path: read_object_points(path, unit="m")[0],
    "cameras": read_camera_positions,
    "project points": lambda path: read_points(path, ()),
    "control": lambda path: by_control({n: np.array(p) for n, p in PLACES.items()}, path, 0.003),
}


def read_with_remarks(reader, path: Path):
    with recording("test"):
        return READERS[reader](path), noted_remarks()


@pytest.mark.parametrize(
    ("reader", "form"),
    [
        (reader, form)
        for reader in READERS
        for form in (markers_csv, gcp_list, markers_xml)
        # E, N, H are not in a project's frame, where picks are intersected.
        if form is markers_csv or reader != "project points"
    ],
)
def test_a_point_of_several_rows_is_taken_once_and_that_is_said(tmp_path, reader, form):
    name, text = form([(n, *place) for n, place in PLACES.items()])
    (tmp_path / name).write_text(text)
    read, remarks = read_with_remarks(reader, tmp_path / name)
    assert any("rows name 3 points; each is taken once" in remark for remark in remarks)
    if reader in ("object points", "cameras"):
        places = read.xyz if reader == "object points" else read.centres
        assert dict(zip(read.ids, places.tolist(), strict=True)) == {
            n: [*place] for n, place in PLACES.items()
        }


@pytest.mark.parametrize("reader", READERS)
def test_rows_that_contradict_each_other_are_both_named(tmp_path, reader):
    name, text = markers_csv([(n, *place) for n, place in PLACES.items()])
    (tmp_path / name).write_text(text.replace("P1,10.0,20.0,5.0,2", "P1,10.0,20.1,5.0,2"))
    with pytest.raises(WorkbookError, match=r'A3 .*"P1" stands in A2 already, with other'):
        READERS[reader](tmp_path / name)


@pytest.mark.parametrize(
    "headings",
    ["name,px,py,image", "label,pixel x,pixel y,filename", "gcp_name,im_x,im_y,image_name",
     "id,u,v,camera", "Punkt,Spalte,Zeile,Bild"],
)  # fmt: skip
def test_pixels_are_called_in_every_room_as_programs_call_them(tmp_path, headings):
    path = tmp_path / "picks.csv"
    path.write_text(f"{headings}\nP1,10,20,far.JPG\n")
    control = read_control(path, photos=1, names=("far.jpg",))
    assert (control.ids, control.pixels1.tolist()) == (("P1",), [[10, 20]])
    for columns, photo in ((COLUMNS, "photo"), (_IMAGE, "camera")):
        table = read_table(path, columns)
        assert [table.numbers(key)[0] for key in ("col", "row")] == [10, 20]
        assert table.texts(photo) == ["far.JPG"]
