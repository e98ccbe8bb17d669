"""The Python API: what `import bifocal` and `import multimedia` offer, and how fast."""

from __future__ import annotations

import dataclasses
import inspect
import pydoc
import re
import rlcompleter
import subprocess
import sys
from importlib.metadata import version
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

import bifocal
import multimedia
from tests.tables import each

PACKAGES = [bifocal, multimedia]
NAMES = [
    pytest.param(package, name, id=f"{package.__name__}.{name}")
    for package in PACKAGES
    for name in package.__all__
]
PROMISED = {
    "bifocal": "relief relief_displacements plane_coordinates Pair dense_relief orthophoto align "
    "match calibrate mosaic solve georeference",
    "multimedia": "Layers water_refractive_index radial_shift ShiftTable Camera project intersect "
    "resect bundle_adjust epipolar_curve correct_bathymetry",
}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_what_is_promised_is_offered(package) -> None:
    assert set(PROMISED[package.__name__].split()) <= set(package.__all__)
    assert set(package.__all__) <= set(dir(type(package)))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_help_is_the_table_of_contents_and_no_manual(package) -> None:
    lines = pydoc.render_doc(package, renderer=pydoc.plaintext).splitlines()
    assert len(lines) <= 90
    assert not {"CLASSES", "FUNCTIONS"} & set(lines)


def test_the_prompt_completes_public_names() -> None:
    prompt = rlcompleter.Completer({"bifocal": bifocal, "multimedia": multimedia})
    assert prompt.complete("bifocal.solv", 0) == "bifocal.solve("
    assert prompt.complete("multimedia.radial_shift_r", 0) == "multimedia.radial_shift_ratio("


@each(("package", "name"), NAMES)
def test_every_name_stands_in_the_table_of_contents(package, name: str) -> None:
    assert re.search(rf"\b{name}\b", package.__doc__)
    assert getattr(package, name).__doc__


def _types_in(hint: object) -> set[type]:
    """Return the classes an annotation speaks of."""
    inside = [part for part in get_args(hint) if get_origin(hint) is not Literal]
    lists = [part for part in inside if isinstance(part, list)]
    inside += [part for parts in lists for part in parts]
    own = {hint} if isinstance(hint, type) else set()
    return own.union(*map(_types_in, inside))


@each(("package", "name"), NAMES)
def test_every_type_in_the_signature_of_a_name_of_the_contents_is_importable(package, name) -> None:
    value = getattr(package, name)
    topics = package.__doc__.split("What they take and give")[0]
    if not re.search(rf"\b{name}\b", topics) or name == "Session":
        return  # what a type is made of is its own affair
    members = [value]
    if inspect.isclass(value):
        members += [
            getattr(member, "fget", None) or getattr(member, "__func__", member)
            for key, member in vars(value).items()
            if not key.startswith("_")
        ]
    for member in filter(lambda m: inspect.isclass(m) or inspect.isfunction(m), members):
        hints = {k: v for k, v in get_type_hints(member).items() if not k.startswith("_")}
        for kind in _types_in(tuple[tuple(hints.values())]):
            if kind.__module__.split(".")[0] in ("bifocal", "multimedia", "photocore"):
                assert getattr(package, kind.__name__, None) is kind, f"{kind} in {name}: add it"


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_the_contents_of_a_package_fit_a_screen(package) -> None:
    assert len(package.__doc__.splitlines()) <= 64


@pytest.mark.parametrize(
    "name",
    [
        "align",
        "match",
        "dense_relief",
        "orthophoto",
        "mosaic",
        "calibrate",
        "relief",
        "solve",
        "georeference",
    ],
)
def test_public_functions_are_documented_in_full(name: str) -> None:
    function = getattr(bifocal, name)
    assert inspect.isfunction(function), "a submodule must never hide a public function"
    text = inspect.getdoc(function)
    for part in ("Parameters", "Returns", "Raises", "Examples"):
        assert f"{part}\n{'-' * len(part)}\n" in text
    for parameter in inspect.signature(function).parameters:
        assert re.search(rf"^(.*, )?{parameter}(,.*)? : ", text, re.M), parameter


def _described(text: str, name: str) -> bool:
    return re.search(rf"^(.*, )?\**{name}(,.*)?( : .*)?$", text, re.M) is not None


@each(("package", "name"), NAMES)
def test_every_name_says_what_it_takes_and_gives(package, name: str) -> None:
    value = getattr(package, name)
    text = inspect.getdoc(value) or ""
    if inspect.isclass(value):
        text = "\n".join(inspect.getdoc(kind) or "" for kind in value.__mro__[:-1])
        fields = (
            [f.name for f in dataclasses.fields(value) if f.init and f.name[0] != "_"]
            if (dataclasses.is_dataclass(value))
            else getattr(value, "_fields", ())
        )
        assert not fields or re.search(r"^(Parameters|Attributes)\n-+$", text, re.M)
        assert [field for field in fields if not _described(text, field)] == []
    elif inspect.isfunction(value):
        signature = inspect.signature(value)
        assert not signature.parameters or "Parameters\n----------\n" in text
        assert [key for key in signature.parameters if not _described(text, key)] == []
        gives = signature.return_annotation not in ("None", None)
        assert not gives or re.search(r"^(Returns|Yields)\n-+$", text, re.M)


@pytest.mark.parametrize(
    ("package", "name", "message"),
    [
        (bifocal, "reliefs", "bifocal has no 'reliefs'; did you mean 'relief'?"),
        (bifocal, "Qwert", "bifocal has no 'Qwert'. Public names: help(bifocal)"),
        (multimedia, "radialshift", "did you mean 'radial_shift'?"),
    ],
)
def test_a_name_that_is_not_offered_is_answered_with_the_nearest(package, name, message) -> None:
    with pytest.raises(AttributeError, match=re.escape(message)):
        getattr(package, name)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_the_version_is_that_of_the_distribution(package) -> None:
    assert package.__version__ == version("bifocal-relief")


HEAVY = ("numpy", "scipy", "cv2", "skimage", "rasterio", "openpyxl", "click", "matplotlib", "numba")


@pytest.mark.parametrize("name", ["bifocal", "multimedia"])
def test_importing_a_package_imports_nothing_heavy(name: str) -> None:
    code = f"import sys, {name}; print(*(m for m in {HEAVY!r} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_solving_a_survey_imports_neither_scipy_nor_the_network() -> None:
    unused = (
        "scipy",
        "cv2",
        "skimage",
        "rasterio",
        "matplotlib",
        "numba",
        "pyarrow",
        "ssl",
        "http",
    )
    code = (
        "import sys, bifocal.cli.solve, bifocal.workbook.workflow, bifocal.workbook.output\n"
        f"print(*(m for m in {unused!r} if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("name", ["bifocal", "multimedia"])
def test_the_list_of_commands_imports_nothing_heavy(name: str) -> None:
    code = (
        f"import sys\nfrom {name}.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        f"print(*(m for m in {HEAVY!r} if m in sys.modules and m != 'click'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].split() == []
