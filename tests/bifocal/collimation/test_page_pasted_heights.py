"""E, N, H of an upright wall pasted on the page: as `bifocal align` takes them from its control."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import SAMPLE, InputError, Pair
from bifocal.collimation.job_tasks import task_of
from bifocal.collimation.pasted import _with_headings
from bifocal.model.world_frame import WorldFrame
from bifocal.orientation.align_workflow import AlignOptions, control_of
from tests.page_session import client_of, opened, sample_folder

WALL = np.array([(-5, -3, 0), (5, -3, 0), (5, 3, 0), (-5, 3, 0), (0, 0.3, 0.3), (2, 2, 0)], float)
#: X from the first point, and heights above the sea. [m]
START, RISE = np.array([5, 250, 0]), np.array([0, 250, 0])
FRAME = WorldFrame(east=652345.0, north=6862123.0, height=0.0, azimuth=np.deg2rad(137.0))
WORLD = FRAME.to_world(WALL + RISE)


def listed(*, pixels: bool, rows=range(6), heading="Punkt;Ost;Nord;Höhe NHN"):
    pair = Pair.read(SAMPLE / "facade.pair.json")
    lines = [heading + ";col1;row1;col2;row2" * pixels]
    for k in rows:
        spots = np.ravel(pair.project(WALL[k])) if pixels else ()
        lines.append(";".join([f"P{k}", *(f"{v:.4f}" for v in (*WORLD[k], *spots))]))
    return "\n".join(lines)


def known(session):
    return np.array([p.known for p in session.state.sorted_control()], float)


def test_pasted_with_pixels_they_become_x_along_the_wall_y_and_r(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        session.command({"op": "control.paste", "text": listed(pixels=True)})
        # X counts from the leftmost point.
        np.testing.assert_allclose(known(session), WALL + START, atol=2e-4)
        shown = client_of(session).get("/api/state").json()["pair"]["remarks"]
        assert any("E, N, H of an upright wall" in text for text in shown)
        # More of the same wall lies in the same frame; both can be taken back.
        more = listed(pixels=False, rows=(4, 1)).replace("P", "Q")
        session.command({"op": "control.paste", "text": more.replace("Qunkt", "Punkt")})
        names = session.state.control
        assert names["Q1"].known == pytest.approx(names["P1"].known, abs=1e-3)
        session.command({"op": "undo"})
        session.command({"op": "undo"})
        assert not session.state.control
        assert not session.state.pasted.get("control")


@pytest.mark.parametrize(
    ("text", "heading"),
    [("P1;2,5", "id;X"), ("P1\t2\t3", "id\tX\tY"), ("id;X\nP1;2", "id;X"), ("P1", "P1")],
)
def test_numbers_pasted_without_headings_are_a_name_x_y_and_so_on(text, heading) -> None:
    assert _with_headings(text).splitlines()[0] == heading


def test_picks_of_the_page_tell_the_front_and_without_them_it_is_asked(tmp_path) -> None:
    pair = Pair.read(SAMPLE / "facade.pair.json")
    with opened(sample_folder(tmp_path)) as session:
        with pytest.raises(InputError, match="Pick three of its points in one photo") as refused:
            session.command({"op": "control.paste", "text": listed(pixels=False)})
        assert "--" not in str(refused.value)
        assert not session.state.control
        for k in range(3):
            spot = pair.project(WALL[k])[1]
            fields = {"image": 2, "column": spot[0], "row": spot[1]}
            session.command({"op": "control.pick", "name": f"P{k}", **fields})
        session.command({"op": "control.paste", "text": listed(pixels=False)})
        np.testing.assert_allclose(known(session), WALL + START, atol=2e-4)


def test_the_frame_goes_into_the_pair_that_is_aligned(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        session.command({"op": "control.paste", "text": listed(pixels=True)})
        task = task_of(session, "align", {"way": "control"})
    options = AlignOptions(control=task.options.control, world=task.options.world)
    control = control_of(options, [(1536, 1024)] * 2, ("far.jpg", "near.jpg"))
    np.testing.assert_allclose(control.frame.to_world(control.xyz), WORLD, atol=2e-4)


def test_numbers_of_a_grid_without_headings_are_asked_about(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        bare = listed(pixels=True).partition("\n")[2]
        with pytest.raises(InputError, match="Write above the columns what they are: name E N H"):
            session.command({"op": "control.paste", "text": bare})
        session.command({"op": "control.paste", "text": "A\t652345,5\t12,25\nB\t652350\t14"})
        assert session.state.control["A"].known == (652345.5, 12.25, None)
