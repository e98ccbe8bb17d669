"""Remarks: every key is used and has its words in three languages, with the same blanks."""

import json
import pickle
import re
import subprocess
import sys
from functools import cache
from itertools import groupby
from pathlib import Path
from string import Formatter

from bifocal.remarks import in_language, remark
from photocore.errors import InputError
from photocore.jsonfile import write_object
from photocore.workbook.making.words import LANGUAGES
from tests.tables import each

CODE = {
    path: path.read_text(encoding="utf-8")
    for package in ("bifocal", "multimedia", "photocore")
    for path in Path(package).rglob("*.py")
}
KEYS = sorted(remark.texts)
SECTIONS = {name: list(keys) for name, keys in groupby(KEYS, lambda key: key.split(".")[0])}


def blanks(text):
    return sorted({(name, form) for _, name, form, _ in Formatter().parse(text) if name})


def sample(text):
    """Values for the blanks of a text."""
    return {
        name: {"d": 3, "s": "0.4"}.get(form[-1], 0.4375) if form else f"P{place}"
        for place, (name, form) in enumerate(blanks(text))
    }


@cache
def said_of(section):
    """Return what the code names of a section of the remarks."""
    stem = rf"[\"']{re.escape(section)}\."
    return {one for text in CODE.values() for one in re.findall(rf"{stem}([\w{{}}' .]*)", text)}


@each("section", SECTIONS)
def test_a_remark_has_its_words_in_three_languages_with_the_same_blanks(section):
    for key in SECTIONS[section]:
        texts = remark.texts[key]
        assert tuple(texts) == LANGUAGES, key
        assert all(blanks(texts[language]) == blanks(texts["en"]) for language in LANGUAGES), key


@each("section", [section for section in SECTIONS if section != "word"])
def test_a_remark_is_known_wherever_it_stands(section):
    for key in SECTIONS[section]:
        texts, values = remark.texts[key], sample(remark.texts[key]["en"])
        told = remark(key, **values)
        assert (told.key, told.values) == (key, values)
        for language in LANGUAGES:
            words = texts[language].format(**values)
            assert in_language(str(told), language) == words
            assert in_language(f"pair.json: {told}", language) == f"pair.json: {words}"


@each("section", [section for section in SECTIONS if section != "word"])
def test_a_remark_is_used(section):
    said = [re.split("[{']", one)[0] for one in said_of(section)]
    unused = [key for key in SECTIONS[section] if not key.split(".")[1].startswith(tuple(said))]
    assert not unused


def test_every_remark_that_code_names_has_words():
    call = re.compile(r"""\bremark\(\s*(["'])([\w.]+)\1""")
    named = {key for text in CODE.values() for _, key in call.findall(text)}
    assert named
    assert named <= set(KEYS)


def test_what_holds_no_remark_stays_as_it_is():
    assert in_language("nothing of ours", "it") == "nothing of ours"
    like_one = remark.texts["survey.off_radial_more"]["en"].format(count=4711)
    assert in_language(like_one, "de") == like_one


@each("language", LANGUAGES)
@each("section", [section for section in SECTIONS if section != "word"])
def test_names_that_read_like_words_of_a_remark_stay_whole(section, language):
    for key in SECTIONS[section]:
        texts = remark.texts[key]
        values = {n: v if v in (3, 0.4375) else f"north and east: {n} of it"
                  for n, v in sample(texts["en"]).items()}  # fmt: skip
        assert in_language(f"{remark(key, **values)} ", language) == (
            texts[language].format(**values) + " "
        )


def test_a_remark_within_another_is_translated_too():
    why = remark("survey.off_radial_more", count=3)
    told = remark("relief.pair_left_out", far="a", near="b", why=f"x ({why})")
    assert "altri 3 punti" in in_language(f"{told}!", "it")


def test_a_file_keeps_key_values_and_level_and_another_program_reads_them(tmp_path):
    names = {"far": "north and east", "near": "south", "why": "too dark"}
    path = tmp_path / "a.json"
    told = remark("relief.pair_left_out", of="wall.json", **names)
    write_object(
        path, {"remarks": [told], "refused": str(InputError(remark("page.give_name", field="x")))}
    )
    held = json.loads(path.read_text())
    assert held["remarks"] == [str(told)]
    kept = held["remark_keys"][str(told).removeprefix("wall.json: ")]
    assert kept == {"key": "relief.pair_left_out", "values": names, "level": "doubt"}
    assert [one["level"] for one in held["remark_keys"].values()] == ["doubt", "stop"]
    code = (
        "from photocore.jsonfile import read_json; from bifocal.remarks import in_language;"
        f"print(in_language(read_json({str(path)!r}, what='file')['remarks'][0], 'it'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert done.stdout.decode().strip() == "wall.json: " + remark.texts["relief.pair_left_out"][
        "it"
    ].format(**names)


def test_a_remark_that_crosses_to_another_process_keeps_what_it_is_made_of():
    told = remark("survey.off_radial_more", count=5)
    again = pickle.loads(pickle.dumps(told))
    assert (again, again.key, again.values, again.level) == (told, told.key, {"count": 5}, "doubt")
