"""`bifocal doctor BOOK.xlsx`: what no program would read, and what calculates to something else."""

from __future__ import annotations

import json
import re

import openpyxl
import pytest
from click.testing import CliRunner

from bifocal.workbook.template_workflow import write_template
from photocore import machine
from photocore.workbook.reading.package import package_faults
from tests.bare_workbook import parts, with_parts
from tests.bifocal.workbook.test_survey_workbook import ideal_content, written
from tests.builders.commands import bifocal_command as main

SHEET = "xl/worksheets/sheet3.xml"


def doctor(path, *words):
    return CliRunner().invoke(main, ["doctor", str(path), *words])


def changed(source, target, change):
    """Copy a workbook with the sheet Points changed."""
    return with_parts(source, {SHEET: change(parts(source)[SHEET].decode()).encode()}, target)


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    path = tmp_path_factory.mktemp("doctor") / "book.xlsx"
    path.write_bytes(written(ideal_content, 26))
    return path


@pytest.mark.acceptance
@pytest.mark.office
def test_a_workbook_of_ours_is_sound(book):
    sound = doctor(book)
    assert sound.exit_code == 0, sound.stderr
    assert "0 cells differ when calculated anew" in sound.stdout


@pytest.mark.acceptance
@pytest.mark.office
def test_a_stale_result_is_named_with_both_numbers_and_all_others_are_sound(book, tmp_path):
    before = book.read_bytes()

    def stale(text):
        head, place, rest = text.partition('<c r="Q5"')
        return head + place + re.sub("</f><v>[^<]*", "</f><v>7.25", rest, count=1)

    found = doctor(changed(book, tmp_path / "stale.xlsx", stale), "--json")
    assert found.exit_code == 1
    assert "solve it again" in found.stderr
    differ = json.loads(found.stdout)["differ"]
    assert list(differ) == ["Points!Q5"]
    right = openpyxl.load_workbook(book, data_only=True)["Points"]["Q5"].value
    assert differ["Points!Q5"][0] == "7.25"
    assert float(differ["Points!Q5"][1]) == pytest.approx(right, rel=1e-9)
    assert book.read_bytes() == before


@pytest.mark.acceptance
@pytest.mark.office
def test_functions_that_libreoffice_does_not_know_are_no_difference(tmp_path):
    write_template(tmp_path / "functions.xlsx", functions=True, rows=3)
    found = doctor(tmp_path / "functions.xlsx", "--json")
    assert found.exit_code == 0, found.stdout
    assert len(json.loads(found.stdout)["unknown"]) == 8


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("</sheetData>", "", "not valid XML"),
        ("</sheetData>", '</sheetData><drawing r:id="rId99"/>', "has no relation rId99"),
        (" r=", " r =", ""),
    ],
)
def test_what_no_program_would_read_is_named(old, new, fault, book, tmp_path):
    ours = 'xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships" '

    def broken(text):
        return text.replace("<worksheet ", f"<worksheet {ours}", 1).replace(old, new, 1)

    found = package_faults(changed(book, tmp_path / "broken.xlsx", broken))
    assert any(fault in text for text in found) if fault else found == []


def test_formulas_too_long_or_too_deep_are_named(book, tmp_path):
    for formula, told in (("1+" * 4500 + "1", "9001 char"), ("(" * 65 + "1" + ")" * 65, "65 brac")):
        text = f"</f><f>{formula}</f>"
        path = changed(book, tmp_path / "long.xlsx", lambda s, t=text: s.replace("</f>", t, 1))
        assert any(told in fault for fault in package_faults(path))


def test_without_libreoffice_it_says_so(book, monkeypatch):
    monkeypatch.setattr(machine, "OFFICE", ("no-such-program",))
    found = doctor(book)
    assert found.exit_code == 0
    assert "nothing was calculated anew" in found.stdout
