"""Feed damaged files to every reader; only errors of the family may come out.

A little of it runs with the tests. For long::

    python -m tests.fuzz_readers --minutes 10 --seed 5 [--reader ply]

prints each crash once, with the seed that repeats it.
"""

from __future__ import annotations

import argparse
import io
import random
import re
import tempfile
import time
import traceback
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from bifocal import (
    Lens,
    Pair,
    ProjectOptions,
    ReliefMap,
    photos_from_project,
    read_image,
    solve,
)
from bifocal.files.point_tables import read_survey_points
from multimedia import PhotogrammetryError, read_experiment, read_project
from multimedia.projects.dem import Dem
from multimedia.projects.surface_files import read_water_surface
from photocore.camera.boards import detect_board
from photocore.cloud import open_cloud
from photocore.images import image_info
from photocore.raster import Window
from tests.attack.site import MESHROOM, make_site

#: Numbers and words that readers stumble over.
TOKENS = (
    "nan", "inf", "-inf", "1e300", "-1e300", "1e400", "9" * 400, "9" * 5000, "-1", "0", "-0.0",
    "1e-320", "3.5", "true", "null", "[]", "{}", '"x"', "0x10", "1,5", "1_0", "", " ", "\x00",
    "\ud800", "½", "[" * 2000, "2147483648", "18446744073709551616", "=1+1", "#REF!", "\ufeff",
)  # fmt: skip
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


class Reader(NamedTuple):
    """What reads a kind of file, and a valid one of the site."""

    valid: str
    read: Callable[[Path], Any]


def _image(path: Path) -> None:
    image_info(path)
    detect_board(read_image(path, grey=True), path.name, pattern="chessboard", size=(7, 5))


def _cloud(path: Path) -> None:
    for _ in open_cloud(path).pieces(numbers=("gps_time",), texts=("id",)):
        pass


def _dem(path: Path) -> None:
    with Dem(path) as dem:
        dem.heights(Window(0, 0, min(dem.width, 500), min(dem.height, 500)))


def _experiment(path: Path) -> None:
    """Read the OpenPTV folder a damaged file lies in."""
    read_experiment(path.parents[1])


def _project(path: Path) -> None:
    """Make a set of a project one of whose files is damaged."""
    photos = next((one for one in path.parents if one.name == "project"), path.parent)
    options = ProjectOptions(
        images=photos, points=photos.with_name("project.csv"), wall=("A", "B", "C")
    )
    with tempfile.TemporaryDirectory() as folder:
        photos_from_project(path, Path(folder) / "o.photos.json", options)


READERS: dict[str, Reader] = {
    "pair": Reader("wall.pair.json", Pair.read),
    "lens": Reader("lens.json", Lens.read),
    "toml": Reader("tank.toml", read_project),
    "toml points": Reader(
        "tank_object_points.csv", lambda p: read_project(p.with_name("tank.toml"))
    ),
    "csv": Reader("result.csv", read_survey_points),
    "xlsx": Reader("survey.xlsx", solve),
    "ods": Reader("survey.ods", read_survey_points),
    "openptv control": Reader("ptv/parameters/ptv.par", _experiment),
    "openptv camera": Reader("ptv/cal/cam1.tif.ori", _experiment),
    "openptv distortion": Reader("ptv/cal/cam2.tif.addpar", _experiment),
    "openptv targets": Reader("ptv/cal/cam1.tif_targets", _experiment),
    "openptv body": Reader("ptv/cal/calblock.txt", _experiment),
    "ply": Reader("cloud.ply", _cloud),
    "ply mesh": Reader("mesh.ply", lambda p: read_water_surface(str(p))),
    "obj mesh": Reader("mesh.obj", lambda p: read_water_surface(str(p))),
    "las": Reader("cloud.las", _cloud),
    "laz": Reader("cloud.laz", _cloud),
    "text cloud": Reader("cloud.csv", _cloud),
    "relief": Reader("relief.tif", ReliefMap.read),
    "dem": Reader("dem.tif", _dem),
    "jpeg": Reader("far.jpg", _image),
    "water": Reader("water.json", lambda p: read_water_surface(str(p))),
    "colmap": Reader("cameras.txt", Lens.read),
    "opencv": Reader("lens.yml", Lens.read),
    "metashape": Reader("lens.xml", Lens.read),
    "meshroom": Reader(f"project/{MESHROOM}", lambda p: _project(p.parents[2])),
    **{
        f"project {name}": Reader(f"project/{name}", _project)
        for name in (
            "text/cameras.txt",
            "text/images.txt",
            "text/points3D.txt",
            "binary/cameras.bin",
            "binary/images.bin",
            "binary/points3D.bin",
            "cameras.xml",
            "reconstruction.json",
            "cameras.sfm",
            "sfm_data.json",
            "bundle.out",
            "transforms.json",
            "cameras.csv",
            "DSC_0.xmp",
            "model.nvm",
        )
    },
}


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return a damaged copy: of a zip one member, of text its numbers, of bytes anything."""
    if data.startswith(b"PK") and rng.random() < 0.9:
        return _mutated_zip(data, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        kind = rng.randrange(7)
        at, size = rng.randrange(len(data) + 1), rng.choice((1, 2, 8, 60, 1000))
        if kind == 0:
            data = data[:at]
        elif kind == 1:
            data = data[:at] + data[at + size :]
        elif kind == 2:
            data = data[:at] + data[at : at + size] * rng.choice((2, 3, 50)) + data[at:]
        elif kind == 3:
            data = data[:at] + rng.randbytes(size) + data[at + size :]
        elif kind == 4:
            data = data[:at] + bytes(rng.choice((0, 255)) for _ in range(size)) + data[at + size :]
        else:
            data = _exchanged_token(data, rng)
    return data


def _exchanged_token(data: bytes, rng: random.Random) -> bytes:
    token = rng.choice(TOKENS).encode("utf-8", "surrogatepass")
    places = list(re.finditer(rb"-?\d[\d.eE+-]*|\w+|\"[^\"]*\"|[\[\]{},:]", data[:20_000]))
    if not places:
        return data
    place = rng.choice(places)
    return data[: place.start()] + token + data[place.end() :]


def _mutated_zip(data: bytes, rng: random.Random) -> bytes:
    with zipfile.ZipFile(io.BytesIO(data)) as package:
        members = {name: package.read(name) for name in package.namelist()}
    name = rng.choice(list(members))
    members[name] = mutated(members[name], rng)
    if rng.random() < 0.1:
        del members[name]
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as package:
        for name, content in members.items():
            package.writestr(name, content)
    return target.getvalue()


class Crash(NamedTuple):
    """An error that is not of the family."""

    reader: str
    seed: int
    place: str
    error: str


def attack(reader: str, folder: Path, seed: int) -> Crash | None:
    """Read one damaged file of a site; return what should not have come out."""
    kind = READERS[reader]
    path = folder / kind.valid
    whole = path.read_bytes()
    rng = random.Random(f"{reader} {seed}")
    path.write_bytes(mutated(whole, rng))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            kind.read(path)
    except PhotogrammetryError:
        return None
    except Exception as error:
        ours = [f for f in traceback.extract_tb(error.__traceback__) if "site-packages" not in f[0]]
        place = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}"
        return Crash(reader, seed, place, f"{type(error).__name__}: {error!s:.120}")
    finally:
        path.write_bytes(whole)
    return None


def main() -> int:
    """Fuzz for as long as asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", choices=READERS, action="append")
    parser.add_argument("--keep", type=Path, help="Folder for the files that crash a reader.")
    given = parser.parse_args()
    readers = given.reader or list(READERS)
    met: dict[tuple[str, str], Crash] = {}
    end = time.monotonic() + 60 * given.minutes
    runs = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_site(folder)
        seed = given.seed
        while time.monotonic() < end:
            for reader in readers:
                crash = attack(reader, folder, seed)
                runs += 1
                if crash and (reader, crash.place) not in met:
                    met[reader, crash.place] = crash
                    print(*crash, sep=" | ", flush=True)  # noqa: T201
                    if given.keep:
                        valid = folder / READERS[reader].valid
                        data = mutated(valid.read_bytes(), random.Random(f"{reader} {seed}"))
                        (given.keep / f"{reader}-{seed}{valid.suffix}").write_bytes(data)
            seed += 1
    print(f"{runs} files, {len(met)} kinds of crashes")  # noqa: T201
    return 1 if met else 0


if __name__ == "__main__":
    raise SystemExit(main())
