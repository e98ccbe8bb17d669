"""Page, workbook and command line hold one survey: what one changes the others show."""

from __future__ import annotations

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

import bifocal
from bifocal import SAMPLE, InputError, Pair
from tests.bifocal.collimation.page_truth import noisy_picks
from tests.builders.commands import bifocal_command as main
from tests.page_session import client_of, opened, pick, pick_both, sample_folder, sample_picks
from tests.workbook_lint import lint

BOOK = "facade.xlsx"


def assert_solved_alike(session, path) -> None:
    """Assert that the page shows exactly what `bifocal solve` finds in the workbook."""
    solved = bifocal.solve(path)
    live = {p.name: session.results.row(p) for p in session.state.points.values() if p.is_complete}
    rows = [i for i, name in enumerate(solved.table.ids) if solved.points.use[i]]
    assert {solved.table.ids[i] for i in rows} == set(live)
    for i in rows:
        shown = live[solved.table.ids[i]]
        for key in ("r", "X", "Y", "sigma_r", "e1"):
            assert shown[key] == pytest.approx(solved.table[key][i], rel=0, abs=1e-9)
        assert shown["flag"] == solved.table.flags[i]


def test_picks_with_noise_give_the_relief_of_solve(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        for name, picks in noisy_picks(0.3, seed=5).items():
            pick_both(session, name, picks)
        pick(session, "half", 1, (100.0, 100.0))
        session.sync.step()
        assert session.sync.waiting is None
        assert_solved_alike(session, folder / BOOK)
        sheet = openpyxl.load_workbook(folder / BOOK)["Points"]
        keys = [cell.value for cell in sheet[4]]
        formulas = [sheet.cell(5, keys.index(key) + 1).value for key in ("r", "X", "sigma_r")]
        assert all(str(formula).startswith("=") for formula in formulas)
    assert not lint(folder / BOOK)


def test_a_workbook_keeps_its_mode_and_the_link_that_leads_to_it(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    name, picks = next(iter(sample_picks().items()))
    with opened(folder) as session:
        pick_both(session, name, picks)
        session.sync.step()
        book = folder / BOOK
        made = book.stat().st_mode & 0o777
        assert made == (folder / "facade.pair.json").stat().st_mode & 0o777
        book.chmod(0o640)
        elsewhere = folder / "shared.xlsx"
        book.rename(elsewhere)
        book.symlink_to(elsewhere.name)
        pick_both(session, "second", picks)
        session.sync.step()
        assert session.sync.waiting is None
        assert_solved_alike(session, book)
    assert book.is_symlink()
    assert elsewhere.stat().st_mode & 0o777 == 0o640
    assert not [path.name for path in folder.glob(".facade-*.xlsx")]


@pytest.mark.acceptance
def test_changes_go_into_the_workbook_in_place(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    picks = sample_picks()
    names = list(picks)
    with opened(folder) as session:
        for name in names[:6]:
            pick_both(session, name, picks[name])
        session.sync.step()
        book = openpyxl.load_workbook(folder / BOOK)
        book.create_sheet("My notes")["B2"] = "do not lose me"
        book.save(folder / BOOK)
        for number in range(30):  # more than the rows prepared
            pick_both(session, f"N{number}", picks[names[number % 8]])
        session.command({"op": "point.delete", "name": names[1]})
        session.command({"op": "point.rename", "name": names[2], "new": "7"})
        session.command({"op": "point.type", "name": names[3], "type": "wall"})
        session.command({"op": "point.reference", "name": names[5], "r": 0.104})
        session.sync.step()
        assert session.sync.waiting is None
        assert_solved_alike(session, folder / BOOK)
        solved = bifocal.solve(folder / BOOK)
        assert set(solved.table.ids) == set(session.state.points)
        assert solved.points.code[solved.table.ids.index(names[3])] == "PLANE"
        assert solved.check.ids == (names[5],)
        error = session.results.row(session.state.points[names[5]])["r"] - 0.104
        assert solved.check.errors[0, 2] == pytest.approx(error, abs=1e-9)
    assert openpyxl.load_workbook(folder / BOOK)["My notes"]["B2"].value == "do not lose me"
    # What somebody else saved is kept once, before the page's first change of it.
    assert [path.name for path in folder.glob("*.bak*")] == [f"{BOOK}.bak"]
    assert not lint(folder / BOOK)


def typed_rows(path, sheet: str, columns: int) -> list[tuple]:
    """Return what is typed in the first rows of a table, as another program reads it."""
    rows = openpyxl.load_workbook(path)[sheet].iter_rows(values_only=True)
    body = [row[:columns] for row in rows]
    first = next(k for k, row in enumerate(body) if row[0] == "id") + 1
    return body[first : first + 4]


@pytest.mark.acceptance
@pytest.mark.parametrize("between", [True, pytest.param(False, marks=pytest.mark.acceptance)])
def test_rows_of_deleted_points_are_blanked_whole_and_used_again(tmp_path, between: bool) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    with opened(folder) as session:
        client = client_of(session)

        def ask(op: str, **fields: object) -> str | None:
            answer = client.post("/api/command", json={"op": op, **fields})
            assert answer.status_code == 200, answer.text
            return answer.json()["result"]["name"]

        def pick_new(target: str) -> str:
            name = None
            for image, (column, row) in enumerate(picks[target], start=1):
                name = ask("point.pick", name=name, image=image, column=column, row=row)
            return str(name)

        assert [pick_new("T01"), pick_new("T02")] == ["P01", "P02"]
        ask("point.type", name="P02", type="wall")
        ask("point.reference", name="P01", X=-4.1, Y=-2.1, r=0.0)
        session.sync.step()
        assert typed_rows(folder / BOOK, "Points", 2)[1] == ("P02", picks["T02"][0][0])
        for name in ("P01", "P02"):
            ask("point.delete", name=name)
        if between:  # the workbook is written while it holds no point at all
            session.sync.step()
            assert session.sync.waiting is None
            assert typed_rows(folder / BOOK, "Points", 8) == [(None,) * 8] * 4
            assert not session.state.points
        assert [pick_new("T16"), pick_new("T20")] == ["P01", "P02"]
        session.sync.step()
        assert session.sync.waiting is None
        assert_solved_alike(session, folder / BOOK)
        expected = [(*picks[name][0], *picks[name][1]) for name in ("T16", "T20")]
        points = typed_rows(folder / BOOK, "Points", 8)
        assert [row[1:5] for row in points] == [*expected, (None,) * 4, (None,) * 4]
        assert [row[6] for row in points] == [None] * 4
        assert typed_rows(folder / BOOK, "Check", 5) == [(None,) * 5] * 4
    assert not lint(folder / BOOK)


def _change(path, name: str, key: str, value: float | None) -> None:
    """Change a cell as somebody with a spreadsheet program does."""
    book = openpyxl.load_workbook(path)
    sheet = book["Points"]
    keys = [cell.value for cell in sheet[4]]
    for row in sheet.iter_rows(min_row=5):
        if row[0].value == name:
            if key == "all":
                for cell in row[: keys.index("note") + 1]:
                    cell.value = None
            else:
                row[keys.index(key)].value = value
    book.save(path)


@pytest.mark.acceptance
def test_rows_changed_by_others_are_taken_over(tmp_path) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    with opened(folder) as session:
        for name in ("T01", "T02", "T03", "T04"):
            pick_both(session, name, picks[name])
        session.sync.step()
        _change(folder / BOOK, "T01", "col2", 206.25)
        _change(folder / BOOK, "T02", "all", None)
        _change(folder / BOOK, "T03", "col2", 1051.0)
        pick(session, "T03", 2, (1052.5, 803.0))  # the page changed it too: its pick is the last
        session.sync.step()
        assert session.state.points["T01"].picks[1] == (206.25, picks["T01"][1][1])
        assert "T02" not in session.state.points
        assert session.state.points["T03"].picks[1] == (1052.5, 803.0)
        assert_solved_alike(session, folder / BOOK)
        before = {name: point.picks for name, point in session.state.points.items()}
    with opened(folder) as again:
        assert {name: point.picks for name, point in again.state.points.items()} == before
        assert again.sync.waiting is None


@pytest.mark.acceptance
@pytest.mark.parametrize("lock", ["~$facade.xlsx", ".~lock.facade.xlsx#"])
def test_a_workbook_open_elsewhere_waits_in_the_journal(tmp_path, lock: str) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    with opened(folder) as session:
        pick_both(session, "T01", picks["T01"])
        session.sync.step()
        before = (folder / BOOK).read_bytes()
        (folder / lock).write_text("somebody")
        pick_both(session, "T02", picks["T02"])
        session.sync.step()
        assert "is open in" in session.sync.waiting
        assert (folder / BOOK).read_bytes() == before
    with opened(folder) as again:  # the page may end meanwhile
        assert set(again.state.points) == {"T01", "T02"}
        assert "is open in" in again.sync.waiting
        (folder / lock).unlink()
        again.sync.step()
        assert again.sync.waiting is None
        assert_solved_alike(again, folder / BOOK)


def test_a_wrong_cell_is_named_and_nothing_overwritten(tmp_path) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    with opened(folder) as session:
        pick_both(session, "T01", picks["T01"])
        session.sync.step()
        _change(folder / BOOK, "T01", "col1", "about 200")  # type: ignore[arg-type]
        before = (folder / BOOK).read_bytes()
        pick_both(session, "T02", picks["T02"])
        session.sync.step()
        assert "col1" in session.sync.waiting
        assert (folder / BOOK).read_bytes() == before
        assert set(session.state.points) == {"T01", "T02"}


def test_a_survey_of_the_command_line_opens_on_the_page(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    picks = bifocal.Measuring(sigma_px=0.2)
    solved = bifocal.solve(
        SAMPLE / "targets.csv", pair=folder / "facade.pair.json", measuring=picks
    )
    from bifocal.workbook.output import write_result

    write_result(folder / "mine.xlsx", solved)
    with opened(folder / "mine.xlsx") as session:
        assert len(session.state.points) == len(solved.table)
        assert_solved_alike(session, folder / "mine.xlsx")
        assert session.results.sigma_px == 0.2


@pytest.mark.acceptance
def test_another_orientation_reaches_the_formulas(tmp_path) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    pair = Pair.read(folder / "facade.pair.json")
    with opened(folder) as session:
        for name in ("T01", "T16", "T20"):
            pick_both(session, name, picks[name])
        session.sync.step()
    data = pair.to_dict()
    data["image1"]["distance"], data["image2"]["nadir"] = 17.7, [0.02, -0.01]
    from photocore.jsonfile import write_object

    write_object(folder / "facade.pair.json", data, overwrite=True)
    with opened(folder) as session:
        session.sync.step()
        assert session.sync.waiting is None
        assert_solved_alike(session, folder / BOOK)
        found = bifocal.solve(folder / BOOK)
        assert (found.pair.d1, found.pair.image2.nadir.tolist()) == (17.7, [0.02, -0.01])


@pytest.mark.acceptance
def test_many_points_are_written_by_a_process_of_its_own(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("bifocal.collimation.workbook.sync.LARGE", 8)
    folder, picks = sample_folder(tmp_path), sample_picks()
    with opened(folder) as session:
        for name in list(picks)[:9]:
            pick_both(session, name, picks[name])
        session.sync.step()
        pick(session, "T03", 1, (1052.25, 803.0))
        session.sync.step()
        assert session.sync.waiting is None
        assert_solved_alike(session, folder / BOOK)
        assert bifocal.solve(folder / BOOK).points.pixels1[2].tolist() == [1052.25, 803.0]


def test_what_was_accepted_in_doubt_stays_so_in_page_workbook_and_export(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    (name, picks), (other, wrong) = list(sample_picks().items())[:2]
    with opened(folder) as session:
        pick_both(session, name, picks)
        pick(session, other, 1, wrong[0])
        place = {"op": "point.pick", "name": other, "image": 2, "row": wrong[1][1]}
        session.command(place | {"column": wrong[1][0] + 0.1, "doubtful": True})
        session.command(place | {"column": wrong[1][0]})  # moved by the keys: nobody looked anew
        pick(session, other, 1, wrong[0])
        near = session.pictures.needed_pair().d2
        shown = session.results.row(session.state.points[other])
        assert shown["flag"] == "UNCERTAIN"
        assert shown["sigma_r"] == pytest.approx(0.26 * near, rel=0.01)
        assert session.results.row(session.state.points[name])["flag"] != "UNCERTAIN"
        assert session.state.points[other].type == "doubtful"
        with pytest.raises(InputError, match="accepted in doubt"):
            session.command({"op": "point.type", "name": other, "type": "check"})
        session.sync.step()
        assert_solved_alike(session, folder / BOOK)
        listed = bifocal.solve(folder / BOOK)
        assert listed.points.code[listed.table.ids.index(other)] == "DOUBTFUL 2"
        out = folder / "out.csv"
        assert (
            CliRunner().invoke(main, ["export", str(folder / BOOK), "--out", str(out)]).exit_code
            == 0
        )
        row = next(line for line in out.read_text().splitlines() if line.startswith(other))
        assert "UNCERTAIN" in row
    with opened(folder) as again:
        assert again.state.points[other].code == "DOUBTFUL 2"
        again.command(place | {"column": wrong[1][0], "doubtful": False})  # clicked
        assert again.state.points[other].code == ""
        assert again.results.row(again.state.points[other])["flag"] != "UNCERTAIN"
        again.command({"op": "undo"})
        again.command({"op": "point.type", "name": other, "type": "plain"})  # somebody is sure
        assert again.state.points[other].code == ""


def test_points_of_an_ideal_set_up_are_doubtful_too() -> None:
    points = {"id": ["A", "B"], "x1": [4.0] * 2, "y1": [3.0] * 2, "x2": [4.2] * 2, "y2": [3.15] * 2}
    taking = bifocal.Taking(d1=17.5, d2=9.5, c1=35, c2=19)
    solved = bifocal.solve({**points, "code": ["", "dubbio"]}, taking=taking)
    assert solved.table.flags == ("OK", "UNCERTAIN")
    sure, doubtful = solved.table.covariance
    assert doubtful[2, 2] - sure[2, 2] == pytest.approx((0.9 * 9.5) ** 2 / 12)
    # Along the far photo's ray, which leads to the nadir: X and Y grow less as r grows.
    assert (doubtful - sure)[0, 2] < 0
    assert np.linalg.matrix_rank(doubtful - sure, tol=1e-9) == 1
