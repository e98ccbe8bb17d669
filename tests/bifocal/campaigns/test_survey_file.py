"""The survey file says everything that is wrong with it at once."""

from __future__ import annotations

import re
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal import InputError
from bifocal.campaigns import photo_pairing
from bifocal.campaigns.pair_steps import refusal, steps_of
from bifocal.campaigns.survey_file import in_survey_words, read_survey_file
from bifocal.campaigns.workflow import facade_job
from bifocal.options import OF_PAIR, PairMediaOptions
from bifocal.orientation.align_workflow import AlignOptions
from bifocal.orthophotos.ortho_workflow import OrthoTask
from multimedia import Layers
from photocore.images import ImageInfo
from photocore.options import options_of
from tests.bifocal.campaigns.sample_tables import FAR, NEAR
from tests.builders.commands import bifocal_command as main

GOOD = """
format = "bifocal-survey/1"
scale = "1:50"
lens = "lens.json"
products = ["report", "relief"]

[[pair]]
name = "Nord, Hof"
far = "photos/a.jpg"
near = "photos/b.jpg"
control = "a.csv"
scale = 20

[[pair]]
far = "c.jpg"
near = "d.jpg"
bounds = [-4, 0, 4, 7.5]
"""


def test_common_entries_hold_for_every_pair_that_does_not_say_otherwise(tmp_path):
    (tmp_path / "street.toml").write_text(GOOD)
    first, second = read_survey_file(tmp_path / "street.toml")
    assert (first.name, first.options["scale"]) == ("Nord, Hof", 20.0)
    assert (second.name, second.options["scale"]) == ("pair 2", 50.0)
    assert first.folder == tmp_path / "results" / "Nord_Hof"
    assert first.far == tmp_path / "photos/a.jpg"
    assert dict(first.files) == {"lens": tmp_path / "lens.json", "control": tmp_path / "a.csv"}
    assert second.options["bounds"] == (-4.0, 0.0, 4.0, 7.5)
    assert first.products == ("relief", "report")  # in the order of work


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("scal = 50", r"no key 'scal'. Did you mean scale\?"),
        ('scale = "fifty"', 'expected a scale, "1:50" or 50'),
        ("distance1 = -3", "distance1 = -3: expected a number above zero"),
        ("distance1 = true", "expected a number above zero"),
        ("bounds = [1, 2]", "expected a list of 4 numbers"),
        ('quality = "superb"', "expected one of fast, standard, best"),
        ('products = ["poster"]', "expected some of relief, points"),
        ("control = 7", "expected the name of a file"),
        ("port = -1", "port = -1: expected a number zero or more"),
        ("indices = 1.337", "expected a list of numbers"),
        ('port_normal = "up"', 'expected "axis", or a list of 3 numbers'),
        ('prior = "index3=0.1"', "expected a list of texts"),
    ],
)
def test_a_wrong_entry_is_named_with_its_pair(tmp_path, wrong, said):
    (tmp_path / "s.toml").write_text(f'[[pair]]\nname = "A"\nfar = "a"\nnear = "b"\n{wrong}\n')
    with pytest.raises(InputError, match=f"pair A: .*{said}"):
        read_survey_file(tmp_path / "s.toml")


MEDIA = """
indices = [1, 1.49, 1.337]
thicknesses = [0.01]
prior = ["index3=0.003"]
port = 0

[[pair]]
far = "a.jpg"
near = "b.jpg"
control = "a.csv"
port_normal1 = "axis"
port_normal2 = [0.1, 0, 1]

[[pair]]
far = "c.jpg"
near = "d.jpg"
distance1 = 3.5
distance2 = 1.9
"""


def test_photos_of_a_pair_may_be_a_list_and_are_a_set(tmp_path):
    path = tmp_path / "street.toml"
    path.write_text('[[pair]]\nname = "porch"\nphotos = ["a.jpg", "b.jpg", "c.jpg"]\nauto = true\n'
                    "distance1 = 9.5\n")  # fmt: skip
    (job,) = read_survey_file(path, out=tmp_path / "out")
    assert job.photos == tuple(tmp_path / name for name in ("a.jpg", "b.jpg", "c.jpg"))
    assert job.pair_path == tmp_path / "out" / "porch" / "align" / "porch.photos.json"
    assert not refusal(job)
    assert set(steps_of(job)[1].files) == {"far", "near", "photo 3"}
    assert "of two photos" in refusal(replace(job, options={**job.options, "as_set_up": True}))
    for wrong, said in (
        ('[[pair]]\nphotos = ["a.jpg"]', "list photos"),
        ('[[pair]]\nfar = "a.jpg"\nphotos = ["a.jpg", "b.jpg"]', "both"),
        (f"joint = true\n{path.read_text()}", "joint = true adjusts pairs"),
    ):
        path.write_text(wrong)
        with pytest.raises(InputError, match=said):
            read_survey_file(path)


def test_media_are_keys_of_the_file_and_reach_the_set_up(tmp_path):
    """Refused in the words of the file; what `align` knows of media has a key of its name."""
    (tmp_path / "sea.toml").write_text(MEDIA)
    first, second = read_survey_file(tmp_path / "sea.toml")
    step = steps_of(first)[0]
    stated = AlignOptions.from_given({**step.options, **step.files}).media
    assert stated.layers == Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.01,))
    assert (stated.port, stated.sigmas) == ((0.0, 0.0), {"index3": 0.003})
    assert stated.normals[0] == "axis"
    assert stated.normals[1].tolist() == [0.1, 0.0, 1.0]
    assert refusal(first) == ""
    told = in_survey_words(refusal(second))
    assert 'control = "FILE"' in told
    assert "as_set_up = true" in told
    assert not re.search(r"--[a-z]", told)
    for key in (*options_of(PairMediaOptions), "as_set_up"):
        assert key in OF_PAIR
        for command in ("align", "facade"):
            assert key in {p.name for p in main.get_command(None, command).params}


def test_what_a_step_may_be_told_is_a_key_of_the_file_and_an_option_of_facade(tmp_path):
    own = {parameter.name for parameter in main.get_command(None, "facade").params}
    assert {*OF_PAIR} - {"sigma_tie"} <= own  # that is of all pairs together
    said = 'mask = false\nfeather = 0\nmark = "p.csv"\nrelief_gsd = "5mm"\npaper = "A3"\n'
    said += 'cloud = "laz"\ncontrol = "c.csv"\ncolumns = "id=N"\n'
    (tmp_path / "s.toml").write_text(f'{said}[[pair]]\nfar = "a.jpg"\nnear = "b.jpg"\n')
    (job,) = read_survey_file(tmp_path / "s.toml")
    steps = {step.name: step for step in steps_of(job)}
    assert steps["relief"].options == {"relief_gsd": 0.005, "cloud": "laz"}
    for name in ("align", "points", "drawing", "report"):
        assert steps[name].options["columns"] == "id=N"
    drawn = steps["drawing"]
    assert drawn.files["mark"] == tmp_path / "p.csv"
    task = OrthoTask.from_given(
        {k: v for k, v in drawn.options.items() if k not in ("paper", "columns")}
    )
    assert (task.options.mask_hidden, task.options.feather) == (False, 0.0)
    given = {"mask": False, "fill": False, "port": 0.0, "sections": (), "paper": None}
    assert facade_job(FAR, NEAR, tmp_path / "o", given=given).options == {"mask": False, "port": 0}


def test_all_faults_are_told_at_once(tmp_path):
    (tmp_path / "s.toml").write_text(
        'dpi = "x"\n[[pair]]\nname = "A"\nfar = "a"\n[[pair]]\nfar = "a"\nnear = "b"\ngsd = 0\n'
        '[[pair]]\nname="B!"\nfar="a"\nnear="b"\n[[pair]]\nname="b"\nfar="a"\nnear="b"\n'
    )
    with pytest.raises(InputError) as caught:
        read_survey_file(tmp_path / "s.toml")
    text = str(caught.value)
    for part in ("above the pairs: dpi", "pair A: far and near", "pair 2: gsd", "the same name"):
        assert part in text


@pytest.mark.parametrize("text", ["[[pair", 'format = "bifocal-survey/9"', "scale = 50"])
def test_what_is_no_survey_is_refused_by_the_command(tmp_path, text):
    (tmp_path / "s.toml").write_text(text)
    result = CliRunner().invoke(main, ["survey", str(tmp_path / "s.toml")])
    assert result.exit_code == 1
    assert str(tmp_path / "s.toml") in result.stderr


def test_photos_of_a_folder_are_paired_by_what_they_show(tmp_path, capsys):  # noqa: ARG001
    from PIL import Image

    photos = tmp_path / "photos"
    photos.mkdir()
    shutil.copy(FAR, photos / "b far.jpg")
    shutil.copy(NEAR, photos / "c near.jpg")
    Image.open(FAR).rotate(90, expand=True).crop((0, 0, 200, 200)).save(photos / "a other.jpg")
    (photos / "c near.csv").write_text("id\n")
    out = tmp_path / "street.toml"
    result = CliRunner().invoke(main, ["survey", "--init", str(photos), str(out)])
    assert result.exit_code == 0, result.stderr
    (job,) = read_survey_file(out)
    assert {job.far.name, job.near.name} == {"b far.jpg", "c near.jpg"}
    assert job.files["control"] == tmp_path / "photos/c near.csv"
    assert "a other.jpg" in out.read_text()
    assert f"bifocal survey {out} --dry-run" in result.stdout
    again = CliRunner().invoke(main, ["survey", "--init", str(photos), str(out)])
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr


def test_a_pair_that_nothing_controls_is_told_in_words_of_the_file_before_any_work(tmp_path):
    shutil.copy(FAR, tmp_path / "far.jpg")
    shutil.copy(NEAR, tmp_path / "near.jpg")
    begun = CliRunner().invoke(main, ["survey", "--init", str(tmp_path)])
    assert begun.exit_code == 0, begun.stderr
    survey = str(tmp_path / "survey.toml")
    planned = CliRunner().invoke(main, ["survey", survey, "--dry-run"])
    assert planned.exit_code == 1  # as the work itself
    assert " align  cannot\n" in planned.stdout
    ran = CliRunner().invoke(main, ["survey", survey])
    assert ran.exit_code == 1
    assert ran.stdout.startswith("1 pair: 0 made")
    for told in (planned.stdout, ran.stdout):
        assert 'control = "FILE"' in told
        assert "auto = true with one distance" in told
        assert not re.search(r"--[a-z]", told)
    assert CliRunner().invoke(main, ["survey"]).exit_code == 2


def test_a_plan_with_a_file_that_cannot_be_read_ends_as_the_work_would(tmp_path):
    for name, content in (("far.jpg", b"no photo"), ("near.jpg", b""), ("points.csv", b"id\n")):
        (tmp_path / name).write_bytes(content)
    survey = tmp_path / "survey.toml"
    survey.write_text(
        '[[pair]]\nname = "a"\nfar = "far.jpg"\nnear = "near.jpg"\ncontrol = "points.csv"\n'
    )
    for more in ([], ["--json"]):
        planned = CliRunner().invoke(main, ["survey", str(survey), "--dry-run", *more])
        assert planned.exit_code == 1
        assert "near.jpg" in planned.output or "far.jpg" in planned.output


def test_a_plan_opens_photos_and_compares_the_names_of_both_tables(tmp_path):
    (tmp_path / "cut.jpg").write_bytes(FAR.read_bytes()[:60_000])
    lines = "id,X,Y,r,col1,row1,col2,row2\nC1,0,0,0,1,1,1,1\n"
    (tmp_path / "points.csv").write_text(lines)
    survey = tmp_path / "survey.toml"
    pair = (
        f'[[pair]]\nname = "a"\nfar = "{FAR.as_posix()}"\nnear = "{{}}"\ncontrol = "points.csv"\n'
    )
    for near, more, said in (
        ("cut.jpg", "", "cut.jpg: the photo is cut off"),
        (NEAR.as_posix(), 'check = "points.csv"\n', "points.csv: C1 is in"),
    ):
        survey.write_text(pair.format(near) + more)
        planned = CliRunner().invoke(main, ["survey", str(survey), "--dry-run"])
        assert planned.exit_code == 1
        assert said in planned.output


def test_a_length_and_several_are_read():
    for text, lengths in (
        ("[1, 2, 3, 4, 5.5]", ((1, 2, 3, 4, 5.5),)),
        ("[[1, 2, 3, 4, 5.5], [5, 6, 7, 8, 9]]", ((1, 2, 3, 4, 5.5), (5, 6, 7, 8, 9))),
    ):
        assert OF_PAIR["length"].read(tomllib.loads(f"a = {text}")["a"]) == lengths
    for wrong in ([1, 2, 3], [[1, 2, 3, 4]], "1,2,3,4,5", []):
        with pytest.raises(ValueError, match="list of 5 numbers"):
            OF_PAIR["length"].read(wrong)


def test_an_equivalent_and_a_true_focal_length_do_not_tell_which_photo_is_far():
    phone = ImageInfo(path=Path("p.jpg"), size=(40, 30), focal_length=4.2, focal_length_35=28.0)
    camera = ImageInfo(path=Path("c.jpg"), size=(40, 30), focal_length=24.0)  # 36 mm on APS-C
    found = photo_pairing._ordered(phone, camera, 50)
    assert (found.far.name, found.certain) == ("p.jpg", False)
    found = photo_pairing._ordered(phone, replace(camera, focal_length_35=36.0), 50)
    assert (found.far.name, found.certain) == ("c.jpg", True)
    zoom = replace(camera, path=Path("z.jpg"), focal_length=70.0)
    assert photo_pairing._ordered(camera, zoom, 50).far.name == "z.jpg"


@pytest.mark.parametrize(
    "line",
    [
        'vignetting = "cos5"', "contours = 1e-9", "bounds = [0, 0, 0, 0]", "relief_range = [1, -1]",
        'sections = ["z=1"]', 'photos = ["a.jpg", "a.jpg"]',
    ],
)  # fmt: skip
def test_a_survey_file_with_an_impossible_value_is_refused_when_it_is_read(tmp_path, line):
    photos = "" if line.startswith("photos") else 'far = "a.jpg"\nnear = "b.jpg"\n'
    path = tmp_path / "survey.toml"
    path.write_text(f'[[pair]]\nname = "w"\n{photos}{line}\n')
    with pytest.raises(InputError, match=r"one photo is named twice|expected"):
        read_survey_file(path)
