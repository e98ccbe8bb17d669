"""Fields of a class are options of the command line, keys of files and words of the help."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import click
import pytest
from click.testing import CliRunner

from photocore.option_types import POSITIVE, Names, Numbers, Scale
from photocore.options import UNSET, Argument, Typed, declared, options_of

Distance = Annotated[float | None, Typed(POSITIVE, "M", text="To the wall [m].")]


@dataclass(frozen=True, kw_only=True)
class Map:
    """A group."""

    quality: Literal["fast", "best"] = "fast"
    """How good."""
    mask: bool = True
    """Leave empty what is hidden."""


@dataclass(frozen=True, kw_only=True)
class Relief:
    """The options of a command, and examples.

    relief wall.json --distance 2
    """

    source: Annotated[Path, Argument(unit="PAIR")]
    out: Path
    """File to write,  with two spaces
    and a second line."""
    distance: Distance = None
    near: Annotated[Distance, Typed(flag="--near-distance")] = None
    """To the near camera [m]."""
    map: Map = field(default_factory=Map)
    bounds: Annotated[tuple[float, float] | None, Typed(Numbers(2), "A,B")] = None
    names: Annotated[tuple[str, ...], Typed(Names())] = ()
    photos: tuple[Path, ...] = ()
    scale: Annotated[float, Typed(Scale())] = 50.0
    fit: bool = False


@dataclass(frozen=True, kw_only=True)
class Facade:
    """A command whose map has no defaults of its own."""

    map: Annotated[Map, UNSET] = field(default_factory=Map)


def values_of(*typed: str, declaring: type = Relief) -> dict[str, object]:
    caught: dict[str, object] = {}
    command = declared(declaring)(lambda **values: caught.update(values))
    result = CliRunner().invoke(command, typed)
    assert result.exit_code == 0, result.output
    return caught


def test_types_and_defaults_of_fields_say_what_an_option_takes():
    assert values_of("wall.json", "--out", "r.tif") == {
        "source": Path("wall.json"), "out": Path("r.tif"), "distance": None, "near": None,
        "quality": "fast", "mask": True, "bounds": None, "names": (), "photos": (),
        "scale": 50.0, "fit": False,
    }  # fmt: skip
    given = values_of(
        *("wall.json", "--out", "r.tif", "--near-distance", "9,5", "--no-mask", "--bounds", "1,2"),
        *("--names", "a,b", "--photos", "1.png", "--photos", "2.png", "--scale", "1:20", "--fit"),
    )
    assert given["near"] == 9.5
    assert given["mask"] is False
    assert given["bounds"] == (1.0, 2.0)
    assert given["names"] == ("a", "b")
    assert given["photos"] == (Path("1.png"), Path("2.png"))
    assert (given["scale"], given["fit"]) == (20.0, True)


def test_the_string_below_a_field_is_its_help_and_comes_before_that_of_its_type():
    texts = {name: option.attributes["help"] for name, option in options_of(Facade).items()}
    texts |= {n: o.attributes.get("help") for n, o in options_of(Relief).items()}
    assert texts["out"] == "File to write,  with two spaces and a second line."
    assert texts["distance"] == "To the wall [m]."
    assert texts["near"] == "To the near camera [m]."
    assert texts["mask"] == "Leave empty what is hidden."


def test_bounds_units_examples_and_defaults_are_told():
    command = declared(Relief)(lambda **_: None)
    told = CliRunner().invoke(command, ["--help"]).output
    assert "--near-distance M" in told
    assert "[default: 1:50]" in told
    assert "Examples:\n    relief wall.json --distance 2" in told
    refused = CliRunner().invoke(command, ["wall.json", "--out", "r.tif", "--distance", "0"])
    assert refused.exit_code == 2
    assert "must be above zero, got 0." in refused.output
    lacking = CliRunner().invoke(command, ["wall.json"])
    assert "Missing option '--out'" in lacking.output


def test_a_group_without_defaults_tells_what_was_typed_and_still_says_the_default():
    assert values_of(declaring=Facade) == {"quality": None, "mask": None}
    assert options_of(Facade)["mask"].attributes["help"].endswith("[default: mask]")


@pytest.mark.parametrize("program", ["bifocal", "multimedia"])
def test_every_option_of_every_command_has_its_help(program):
    from importlib import import_module

    main = import_module(f"{program}.cli.main").main
    for name in main.list_commands(click.Context(main)):
        for parameter in main.get_command(click.Context(main), name).params:
            if isinstance(parameter, click.Option):
                assert parameter.help, f"{program} {name} {parameter.opts[0]}"
