"""What the schemas of the format say of a part of a workbook: elements, their order, attributes.

`golden/spreadsheetml.txt` holds the facts; elements that it does not name may hold anything.
"""

from __future__ import annotations

import re
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree

_CELL = r"\$?[A-Z]{1,3}\$?[1-9]\d{0,6}"
_AREA = rf"(?:{_CELL}(?::{_CELL})?|\$?[A-Z]+:\$?[A-Z]+|\$?\d+:\$?\d+)"
_TYPES = {
    "": r"(?s:.*)", "bool": "0|1|true|false", "uint": r"\d+", "int": r"-?\d+", "cell": _CELL,
    "number": r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?",
    "area": _AREA, "areas": f"{_AREA}( {_AREA})*", "name": r"[^\W\d][\w.\\]*",
    "title": r"(?!')[^\[\]:*?/\\]{1,31}",
    "text32": "(?s:.{0,32})", "text255": "(?s:.{0,255})",
}  # fmt: skip
_FACTS = Path(__file__).with_name("golden") / "spreadsheetml.txt"
#: Rows of a sheet are alike: the first of them all, then every so many.
_ROWS, _STEP = 40, 25
_RULES: dict[tuple[str, str], tuple[re.Pattern[str], dict[str, re.Pattern[str]], set[str]]] = {}
for _line in _FACTS.read_text(encoding="utf-8").splitlines():
    if _line.startswith("["):
        _space = _line.strip("[]")
    elif not _line.startswith("#"):
        _name, _, _rule = _line.partition(" = ")
        _order, _, _attributes = _rule.partition("|")
        _order = re.sub(r"([\w/]+)([?*+]?) *", r"(?:(?:\1) )\2", _order.strip()).replace("/", "|")
        _keys = [row.rstrip("!").partition(":")[::2] for row in _attributes.split()]
        _types = {
            key: re.compile(_TYPES.get(kind) or kind.replace(",", "|")) for key, kind in _keys
        }
        _needed = {row.split(":")[0].rstrip("!") for row in _attributes.split() if row[-1] == "!"}
        _RULES[_space, _name] = re.compile(_order), _types, _needed


#: Charts, formats and most sheets of one book are those of the next.
_KNOWN: dict[bytes, list[str]] = {}


def schema_faults(data: bytes) -> list[str]:
    """Return what the schemas refuse in one part, of many rows alike in some of them."""
    digest = sha256(data).digest()
    if digest not in _KNOWN:
        _KNOWN[digest] = _faults_of(data)
    return _KNOWN[digest]


def _faults_of(data: bytes) -> list[str]:
    rows = data.split(b"<row ")
    kept = [*rows[:_ROWS], *rows[_ROWS:-1:_STEP], *rows[_ROWS:][-1:]]
    root, faults = ElementTree.fromstring(b"<row ".join(kept)), dict[str, None]()
    for element in root.iter() if not root.tag.endswith("}calcChain") else ():  # its c is another
        children = tuple([child.tag for child in element])
        faults |= dict.fromkeys(_faults(element.tag, children, tuple(element.items())))
    return [*faults]


@lru_cache(maxsize=50_000)
def _faults(tag: str, children: tuple[str, ...], held: tuple[tuple[str, str], ...]) -> list[str]:
    space, _, name = tag.rpartition("}")
    kind = space.removesuffix("/main").removesuffix("/2006").rpartition("/")[2]
    if (kind, name) not in _RULES:
        return []
    names = (child.rpartition("}") for child in children)
    order = "".join(f"{child} " for of, _, child in names if of == space)
    plain = {k.rpartition("}")[2]: v for k, v in held if "}" not in k or k.endswith("}id")}
    rule, types, needed = _RULES[kind, name]
    faults = [f"{name} lacks {key}" for key in sorted(needed - plain.keys())]
    for key, value in plain.items():
        if key not in types or not types[key].fullmatch(value):
            faults.append(f'{name} {key}="{value}"')
    if not rule.fullmatch(order):
        faults.append(f"{name} holds, in this order: {order}")
    return faults
