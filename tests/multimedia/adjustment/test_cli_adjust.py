"""``multimedia adjust`` as a user runs it."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from multimedia import InputError, read_project, write_project
from tests.builders.commands import multimedia_command as main
from tests.web_page import Page


def bundle_project(**changes):
    spec = importlib.util.spec_from_file_location(
        "bundle_cases", Path(__file__).with_name("test_bundle.py")
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.with_true_cameras(module.a_project(**changes), interior=False)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    path = tmp_path_factory.mktemp("adjust") / "tank.toml"
    write_project(path, bundle_project(noise=0.001))
    return path


@pytest.mark.acceptance
def test_adjusting_writes_project_and_report_and_says_the_salinity(project, tmp_path):
    out, report = tmp_path / "new.toml", tmp_path / "r.html"
    arguments = [
        "adjust", str(project), "--interior", "c,xh,yh,k1", "--media", "index3", "--out", str(out),
        "--report", str(report), "--wavelength", "520", "--temperature", "20",
    ]  # fmt: skip
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.stderr
    assert "index3" in result.stdout
    assert "Salinity" in result.stdout
    media = next(iter(read_project(out).media.values()))
    assert media.layers.indices[2] == pytest.approx(1.3365, abs=2e-4)
    text = report.read_text()
    assert "a gross error is found from" in text
    page = Page(text)
    assert all(source.startswith("data:image/svg+xml") for source in page.sources)
    assert len(page.sources) == 3  # residuals on the images, over depth, correlations
    images = base64.b64decode(page.sources[0].partition(",")[2]).decode()
    for name in ("cam0", "cam1", "cam2", "cam3"):
        assert f"<td>{name}</td>" in text
        assert f"<!-- {name} -->" in images
    assert "<!-- x [mm] -->" in images
    assert "http" not in text
    # Media, units, program and options.
    assert re.search(r"<td>1\.00000, 1\.\d+, 1\.336\d+</td>", text)
    assert re.search(r"<td>\w+:k1</td><td>\S+</td><td>\S+</td><td>mm⁻²</td>", text)
    assert "multimedia adjust" in page.text
    assert "tank.toml" in page.text
    assert "Made by bifocal" in page.text
    again = CliRunner().invoke(main, arguments)
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr


def test_water_a_little_fresher_than_fresh_has_a_salinity_all_the_same(project):
    # By Höhle's formula fresh water of 20 °C has 1.3365 at 503.5 nm: 0.07 % are missing at 500 nm.
    options = ["--media", "index3", "--wavelength", "500", "--temperature", "20", "--json"]
    result = CliRunner().invoke(
        main, ["adjust", str(project), "--interior", "c,xh,yh,k1", *options]
    )
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    n = data["unknowns"]["index3"]["value"]
    salinity = data["salinity_percent"]
    assert salinity["value"] == pytest.approx(((n - 1.338) / 4e-5 - 486 + 500 + 20) / 50, abs=1e-6)
    assert salinity["value"] < 0
    assert salinity["sigma"] == pytest.approx(data["unknowns"]["index3"]["sigma"] / 2e-3)


def test_json_holds_values_sigmas_and_correlations(project):
    result = CliRunner().invoke(
        main, ["adjust", str(project), "--interior", "c", "--media", "index3", "--json"]
    )
    data = json.loads(result.stdout)
    assert data["unknowns"]["index3"]["sigma"] > 0
    assert len(data["correlations"]) == len(data["unknowns"])


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["none.toml"], 1, "none.toml"),
        (["PROJECT", "--media", "index7"], 1, "index7"),
        (["PROJECT", "--interior", "focus"], 1, "focus"),
        (["PROJECT", "--interior", "auto,c"], 1, "auto stands alone"),
        (["PROJECT", "--plate", "all"], 1, "no object point belongs to a group"),
        (["PROJECT", "--scale-bar", "1,2"], 1, "first,second,length,sigma"),
        (["PROJECT", "--prior", "offset"], 1, "label=sigma"),
        (["PROJECT", "--control", "maybe"], 2, "maybe"),
        (["PROJECT", "--fix-camera", "cam9"], 1, "cam9"),
        (["PROJECT", "--out", "o.toml", "--report", "./o.toml"], 1, "name two files"),
    ],
)
def test_mistakes_are_named(project, arguments, status, message):
    full = [str(project) if a == "PROJECT" else a for a in arguments]
    result = CliRunner().invoke(main, ["adjust", *full])
    assert result.exit_code == status
    assert message in result.stderr


def test_the_real_cavity_is_adjusted_to_the_known_sigma0(data_dir, tmp_path):
    out = tmp_path / "cavity.toml"
    folder = str(data_dir / "openptv_cavity")
    done = CliRunner().invoke(main, ["openptv", folder, "--swap-indices", "--out", str(out)])
    assert done.exit_code == 0, done.stderr
    # The known sigma0 are of Brown's convention; the import keeps OpenPTV's.
    out.write_text(out.read_text().replace('convention = "openptv"', 'convention = "brown"'))
    done = CliRunner().invoke(
        main, ["adjust", str(out), "--interior", "c,xh,yh,k1,p1,p2,scale", "--json"]
    )
    assert done.exit_code == 0, done.stderr
    sigma0 = json.loads(done.stdout)["sigma0_mm_of"]
    for camera, limit in (("cam1", 5.67), ("cam2", 3.54), ("cam3", 4.54), ("cam4", 3.54)):
        assert sigma0[camera] * 1000 <= limit


@pytest.mark.acceptance
def test_the_real_cavity_does_not_carry_an_index_and_says_so(data_dir, tmp_path):
    out = tmp_path / "cavity.toml"
    folder = str(data_dir / "openptv_cavity")
    CliRunner().invoke(main, ["openptv", folder, "--swap-indices", "--out", str(out)])
    CliRunner().invoke(main, ["resect", str(out), "--out", str(out), "--overwrite"])
    arguments = ["adjust", str(out), "--interior", "c,xh,yh,k1,p1,p2,scale", "--media", "index3"]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0, done.stderr
    assert "index3: the data hardly carry it; it rests on what was given, 1.33" in done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("index3")]
    assert 1.325 < float(line.split()[1]) < 1.335
    assert float(line.split()[2]) >= 0.0045
    thick = ["adjust", str(out), "--media", "index3,thickness1", "--prior", "thickness1=inf"]
    done = CliRunner().invoke(main, [*thick, "--prior", "index3=inf"])
    assert done.exit_code == 1
    assert "thickness1 comes out as" in done.stderr
    assert "--prior thickness1=0.6" in done.stderr


def test_the_files_of_an_adjustment_appear_together_or_not_at_all(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from multimedia.adjustment import workflow

    def full(path: Path, *_: object, **__: object) -> None:
        raise InputError(f"{path}: could not be written (No space left on device).")

    monkeypatch.setattr(workflow, "write_adjustment_report", full)
    arguments = ["adjust", str(project), "--interior", "c", "--media", "index3"]
    arguments += ["--out", str(tmp_path / "o.toml"), "--report", str(tmp_path / "r.html")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1
    assert "No space left on device" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("language", "said"),
    [("it", "Le coordinate immagine sono precise"), ("de", "Medien zwischen Kameras und Objekt")],
)
def test_the_report_speaks_the_language_asked_for(project, tmp_path, language, said):
    out = tmp_path / "r.html"
    words = ["adjust", str(project), "--report", str(out), "--language", language]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.stderr
    assert said in Page(out.read_text("utf-8")).text


@pytest.mark.acceptance
def test_the_report_is_a_pdf_where_its_name_says_so_and_nothing_else(project, tmp_path):
    words = ["adjust", str(project), "--report", str(tmp_path / "r.pdf")]
    assert CliRunner().invoke(main, words).exit_code == 0
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF")
    words[-1] = str(tmp_path / "r.docx")
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 1
    assert "written as .html or .pdf" in result.stderr
