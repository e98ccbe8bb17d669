"""Units that a cloud as text says in its headings, or by its coordinate system."""

import pytest

from photocore.cloud import open_cloud
from photocore.errors import InputError


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("Easting (US survey foot),Northing,Elevation\n3937,7874,39.37\n", "ftUS"),
        ("X (feet),Y (feet),Z (feet)\n3937,7874,39.37\n", "ft"),
        (
            "# CoordinateSystem: EPSG:3436\n#Label,X/Easting,Y/Northing,Z/Altitude\nP,1,2,3\n",
            "ftUS",
        ),
    ],
)
def test_feet_are_refused_however_they_are_said(tmp_path, text, unit):
    (tmp_path / "bed.csv").write_text(text)
    with pytest.raises(InputError, match=f"is in {unit}, but heights and cameras are in metres"):
        open_cloud(tmp_path / "bed.csv")


def test_coordinates_of_a_datum_and_a_system_in_metres_are_taken(tmp_path):
    (tmp_path / "bed.csv").write_text("E LV95;N LV95;Höhe NHN\n1200;2400;12\n", encoding="utf-8")
    (piece,) = open_cloud(tmp_path / "bed.csv").pieces()
    assert piece.xyz.tolist() == [[1200, 2400, 12]]
