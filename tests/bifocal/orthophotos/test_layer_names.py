"""Drawings for CAD: points and sections in place, on layers named as a country does."""

from __future__ import annotations

import ezdxf
import numpy as np
import pytest

from bifocal import Grid
from bifocal.model.points import Points
from bifocal.orthophotos.drawing import TABLES, Drawing, PrintSheet, Section
from bifocal.orthophotos.drawing_files import write_drawing


def points(*ids: str) -> Points:
    blank = ("",) * len(ids)
    xyz = np.array([[0.5 * k, 0.25, 0.1] for k in range(len(ids))])
    return Points(ids=ids, xyz=xyz, sigma_r=xyz[:, 2], flags=blank, notes=blank)


#: A cut along a line that turns, and an upright one from high to low.
BENT = Section(
    name="0,0 1,0 1,1", axis="line", path=np.array([[0.0, 0], [1, 0], [1, 1]]),
    place=np.array([0.5, 1.0, 1.75]), relief=np.array([0.1, 0.2, 0.3]), measured=np.ones(3, bool),
)  # fmt: skip
UPRIGHT = Section(
    name="x=1", axis="x", path=np.array([[1.0, 2.0], [1.0, 0.0]]), place=np.array([0.5, 1.0, 1.5]),
    relief=np.array([0.1, np.nan, np.nan]), measured=np.array([True, False, False]),
)  # fmt: skip


@pytest.mark.parametrize(
    ("language", "manner", "names"),
    [
        ("de", "language", ("VERM_PUNKTE", "VERM_PASSPUNKTE", "VERM_KONTROLLPUNKTE")),
        ("it", "language", ("RIL_PUNTI", "RIL_PUNTI_APPOGGIO", "RIL_PUNTI_CONTROLLO")),
        ("it", "bifocal", ("BIFOCAL_POINTS", "BIFOCAL_CONTROL", "BIFOCAL_CHECK")),
        ("en", "ncs", ("V-NODE", "V-CTRL", "V-CTRL-CHCK")),
    ],
)
def test_points_stand_on_layers_of_a_country(tmp_path, language, manner, names):
    drawing = Drawing(
        title="Torre", grid=Grid.from_bounds((0, 0, 2, 2), gsd=0.05), scale=50.0,
        control=points("C1"),
        cad={"points": points("P1", "P2"), "control": points("no"), "check": points("K1")},
        sections=(BENT,), language=language, layers=manner,
    )  # fmt: skip
    path = tmp_path / "t.dxf"
    write_drawing(path, drawing, PrintSheet.fitting(drawing, None), None)
    model = ezdxf.readfile(path).modelspace()
    found = {name: len(model.query(f'POINT[layer=="{name}"]')) for name in names}
    assert found == dict(zip(names, (2, 1, 1), strict=True))
    assert {"P1", "P2", "C1", "K1"} <= {text.dxf.text for text in model.query("TEXT")}
    (line,) = model.query("POLYLINE")
    places = [tuple(vertex.dxf.location) for vertex in line.vertices]
    assert places == [(0.5, 0, 0.1), (1, 0, 0.2), (1, 0.75, 0.3)]


def test_an_upright_cut_from_high_to_low_lies_at_its_own_y():
    assert UPRIGHT.in_space() == []  # a single place is no line
    whole = Section(**{name: getattr(UPRIGHT, name) for name in ("name", "axis", "path", "place")},
                    relief=np.full(3, 0.1), measured=np.ones(3, bool))  # fmt: skip
    ((measured, line),) = whole.in_space()
    assert measured
    np.testing.assert_allclose(line, [[1, 0.5, 0.1], [1, 1, 0.1], [1, 1.5, 0.1]])


def test_no_two_layers_get_one_name():
    names = TABLES["layer_names"]
    assert set(names) == {*TABLES["layers"], *TABLES["section_layers"]}
    for manner in ("it", "de", "ncs"):
        called = [names[layer][manner] for layer in names]
        assert len(set(called)) == len(called)
        assert all(name.isascii() and name == name.upper() for name in called)
