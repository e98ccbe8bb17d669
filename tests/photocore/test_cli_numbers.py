"""Numbers on the command line: what cannot be meant is wrong usage, said of the option by name."""

from __future__ import annotations

import math
import shlex

import click
import pytest
from click.testing import CliRunner

from photocore.option_types import Length, Number, Numbers, Size
from tests.builders.commands import bifocal_command, multimedia_command
from tests.tables import each

PROGRAMS = {"bifocal": bifocal_command, "multimedia": multimedia_command}
CANON = "--focal 35 --focal 19 --sensor 22.7x15.1"
RING = "design --distance 0.6 --c 25 --extent 0.3x0.3 --depths 0.02x0.2"
DELIVER = "ortho w.pair.json --deliver d"

IMPOSSIBLE = [
    (f"bifocal {DELIVER} --scale 1:50 --contours nan", "--contours", "finite"),
    (f"bifocal {DELIVER} --scale 1:50 --contours 0", "--contours", "0.0001 or more"),
    (f"bifocal {DELIVER} --scale 1:nan", "--scale", "finite"),
    (f"bifocal {DELIVER} --scale 1:50 --dpi 0", "--dpi", "above zero"),
    ("bifocal ortho w.pair.json --out o.tif --feather -1", "--feather", "zero or more"),
    ("bifocal ortho w.pair.json --out o.tif --plane nan", "--plane", "finite"),
    ("bifocal ortho w.pair.json --out o.tif --gsd 0mm", "--gsd", "above zero"),
    ("bifocal mosaic a.tif b.tif --out m.tif --bounds nan,0,1,1", "--bounds", "finite"),
    ("bifocal mosaic a.tif b.tif --out m.tif --bounds 0,0,1", "--bounds", "4 numbers"),
    ("bifocal relief w.pair.json --out r.tif --relief-range 0,inf", "--relief-range", "finite"),
    (f"bifocal plan {CANON} --pixels nanxnan --scale 500", "--pixels", "finite"),
    (f"bifocal plan {CANON} --pixels 3072.5x2048 --scale 500", "--pixels", "whole"),
    (f"bifocal plan {CANON} --pixels 3072x0 --scale 500", "--pixels", "1 or more"),
    (f"bifocal plan {CANON} --pixels 3072x2048 --gsd -2", "--gsd", "above zero"),
    ("bifocal calibrate a.jpg --out l.json --board infx3", "--board", "finite"),
    ("bifocal calibrate a.jpg --out l.json --board 9.5x6", "--board", "whole"),
    ("bifocal calibrate a.jpg --out l.json --straight-edges --focal-px -1", "--focal-px", "above"),
    (
        "bifocal calibrate a.jpg --out l.json --straight-edges --focal-px nan",
        "--focal-px",
        "finite",
    ),
    ("bifocal align a.jpg b.jpg --auto --distance1 -3 --out p.json", "--distance1", "above zero"),
    ("bifocal align a.jpg b.jpg --auto --sigma-pick 1e300 --out p.json", "--sigma-pick", "finite"),
    ("bifocal align a.jpg b.jpg --auto --wall 3,nan --out p.json", "--wall", "finite"),
    ("bifocal match w.pair.json --out s.xlsx --relief-min nan", "--relief-min", "finite"),
    ("bifocal solve s.xlsx --sigma-px 0", "--sigma-px", "above zero"),
    ("bifocal solve s.xlsx --d1 seventeen", "--d1", "not a number"),
    ("multimedia shift p.csv --json --camera nan,0,1", "--camera", "finite"),
    ("multimedia shift p.csv --json --indices 1,inf", "--indices", "finite"),
    (f"multimedia {RING} --half-angle 0", "--half-angle", "above zero"),
    (f"multimedia {RING} --half-angle 90", "--half-angle", "below 90"),
    (f"multimedia {RING} --seed -1", "--seed", "x>=0"),
    (f"multimedia {RING} --indices 1,0", "--indices", "above zero"),
    ("multimedia design --distance 0.6 --c 1e300", "--c", "finite"),
    ("multimedia index --depth nan", "--depth", "finite"),
    ("multimedia index --sigma-temperature nan", "--sigma-temperature", "finite"),
    ("multimedia index --sigma-salinity -0.1", "--sigma-salinity", "zero or more"),
    ("multimedia index --wavelength 0", "--wavelength", "above zero"),
    ("multimedia adjust t.toml --wavelength nan", "--wavelength", "finite"),
    ("multimedia adjust t.toml --robust -1", "--robust", "above zero"),
    ("multimedia bathymetry d.tif --water-level 1 --index nan --out b.tif", "--index", "finite"),
    (
        "multimedia bathymetry d.tif --water-level 1 --index 1.3 --group-index nan --out b.tif",
        "--group-index",
        "finite",
    ),
    (
        "multimedia bathymetry d.tif --water-level 1 --index 1.3 --max-angle 90 --out b.tif",
        "--max-angle",
        "89.9 or less",
    ),
    ("multimedia waterlevel p.csv --spread inf", "--spread", "finite"),
    ("multimedia epipolar t.toml --camera a --to b --at 640.5", "--at", "2 numbers"),
    ("multimedia epipolar t.toml --camera a --to b --chord 0", "--chord", "above zero"),
]


@each(("line", "option", "reason"), IMPOSSIBLE, ids=[c[0] for c in IMPOSSIBLE])
def test_a_number_that_cannot_be_meant_is_wrong_usage(
    line: str, option: str, reason: str, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    program, *words = shlex.split(line)
    result = CliRunner().invoke(PROGRAMS[program], words)
    assert result.exit_code == 2
    assert f"Invalid value for '{option}'" in result.stderr
    assert reason in result.stderr
    assert not list(tmp_path.iterdir())


NUMERIC = [
    pytest.param(parameter, id=f"{program} {name} {parameter.opts[0]}")
    for program, group in PROGRAMS.items()
    for name in group.summaries
    for parameter in group.get_command(click.Context(group), name).params
    # NaN and the lowest of float32 are what many files call empty.
    if parameter.opts != ["--nodata"]
    and (isinstance(parameter.type, Number) or parameter.type.name.startswith("float"))
]


@each("parameter", NUMERIC)
@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e300", "much"])
def test_no_numeric_option_takes_what_is_no_finite_number(
    parameter: click.Parameter, text: str
) -> None:
    kinds = {
        Size: f"{text}x{text}",
        Numbers: ",".join([text] * (getattr(parameter.type, "count", 1) or 1)),
    }
    with pytest.raises(click.BadParameter):
        parameter.type.convert(kinds.get(type(parameter.type), text), parameter, None)


def test_limits_units_and_decimal_commas() -> None:
    assert Number().convert("0,5", None, None) == 0.5
    assert Number(above=0, to=math.radians).convert("180", None, None) == math.pi
    assert Length(above=0).convert("5 mm", None, None) == 0.005
    assert Length().convert("-0,5", None, None) == -0.5
    assert Size(whole=True).convert("8*11", None, None) == (8, 11)
    assert Numbers(2).convert("640.5;371.2", None, None) == (640.5, 371.2)
    assert Numbers().convert("", None, None) == ()
    for number, text in (
        (Number(below=90), "90"),
        (Number(most=89.9), "90"),
        (Number(least=1), "0"),
    ):
        with pytest.raises(click.BadParameter, match=f"got {text}"):
            number.convert(text, None, None)
