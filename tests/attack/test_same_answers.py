"""Lines without a fault answer as they did: numbers to five digits, remarks word by word.

    .venv/bin/python -m tests.attack.test_same_answers     writes the golden answers anew

Whatever in the way from the command line to the answer is changed by accident shows here; lines
that match photos are left out, for their last digits depend on the processor.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import tempfile
from pathlib import Path

from click.testing import CliRunner

from tests.attack.lines import CANON, CURVE, RING, SOLVE, WATER
from tests.attack.site import PROGRAMS, make_site

GOLDEN = Path(__file__).parents[1] / "golden/same_answers.txt"
#: A number, its decimals and its power of ten.
NUMBER = re.compile(r"-?\d+(?:\.(\d+))?(?:e([-+]?\d+))?")
LINES = (
    f"bifocal solve survey.csv {SOLVE} --json",
    f"bifocal solve survey.csv {SOLVE} --sigma-px 0.8 --json",
    f"bifocal solve survey.csv {SOLVE}",
    "bifocal solve survey.xlsx --json",
    "bifocal solve picks.csv --pair wall.pair.json --json",
    "bifocal solve picks3.csv --pair wall.photos.json --json",
    f"{CANON} --scale 500",
    f"{CANON} --scale 500 --json",
    f"{CANON} --scale 200 --json",
    "multimedia index --json",
    "multimedia index --wavelength 640 --temperature 4 --salinity 3.5 --depth 20 --json",
    "multimedia shift shift.csv --z0 1 --indices 1,1.337 --json",
    "multimedia project tank.toml --json",
    "multimedia intersect tank.toml --json",
    "multimedia resect tank.toml --json",
    "multimedia adjust tank.toml --json",
    f"{CURVE} --json",
    "multimedia waterlevel cloud.csv --json",
    "multimedia waterlevel cloud.csv",
    f"multimedia bathymetry cloud.csv --out c.csv {WATER} --json",
    f"multimedia bathymetry cloud.csv --out d.csv {WATER} --cameras eyes.csv --json",
    f"multimedia bathymetry dem.tif --out d.tif {WATER} --json",
    f"{RING} --json",
    "bifocal photos project/text --points project.csv --wall A,B,C --out o.photos.json --json",
    "bifocal rectify far.jpg --control control.csv --out o.tif --json",
)


def shortened(value: object) -> object:
    """Return an answer with numbers of six digits, what is next to nothing as such."""
    match value:
        case dict():
            return {key: shortened(one) for key, one in value.items()}
        case list() if len(value) > 12:  # of long lists every so many
            return [shortened(one) for one in value[:: len(value) // 4]]
        case list():
            return [shortened(one) for one in value]
        case float():
            return float(f"{value:.6g}") if abs(value) > 1e-7 else 0.0
    return value


def answer(line: str) -> str:
    """Return what a line answers, and what it remarks."""
    program, *words = shlex.split(line)
    result = CliRunner().invoke(PROGRAMS[program], words)
    text = result.stdout
    if line.endswith("--json") and result.exit_code == 0:
        text = json.dumps(shortened(json.loads(text)), ensure_ascii=False)
    return f"[{line}] {result.exit_code}\n{text.strip()}\n{result.stderr.strip()}".strip()


def answers(folder: Path) -> list[str]:
    os.chdir(folder)
    return [answer(line).replace(str(folder), "FOLDER") for line in LINES]


def differences(now: str, before: str) -> list[str]:
    """Return in what two answers differ; 1.5 units of a last decimal are none, on no processor."""
    if NUMBER.sub("#", now) != NUMBER.sub("#", before):
        return [now]
    faults = []
    for new, old in zip(NUMBER.finditer(now), NUMBER.finditer(before), strict=True):
        unit = 10.0 ** (int(old[2] or 0) - len(old[1] or ""))
        if abs(float(new[0]) - float(old[0])) > (1.5 * unit if old[1] or old[2] else 0):
            faults.append(f"{new[0]} for {old[0]} after {before[: old.start()][-60:]}")
    return faults


def test_lines_without_a_fault_answer_as_they_did(whole_site, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(whole_site, tmp_path / "site", copy_function=os.link)
    golden = GOLDEN.read_text("utf-8").strip().split("\n\n[")
    failures = [
        f"{line}: {fault}"
        for line, now, before in zip(LINES, answers(tmp_path / "site"), golden, strict=True)
        for fault in differences(now.lstrip("["), before.lstrip("["))
    ]
    way = "On purpose? .venv/bin/python -m tests.attack.test_same_answers writes them anew."
    assert not failures, "\n".join([way, *failures])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        make_site(Path(name))
        GOLDEN.write_text("\n\n".join(answers(Path(name))) + "\n", "utf-8")
