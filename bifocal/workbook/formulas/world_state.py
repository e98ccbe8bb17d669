"""The sentence that says whether the world coordinates can be trusted: a live formula."""

from __future__ import annotations

import re
from collections.abc import Mapping

from bifocal.survey.remarks import SCALE_SHARE

#: Name of its cell, and the keys of its sentences.
STATE = "world_state"
STATES = ("world_few", "world_bad", "world_scale", "world_large", "world_good", "world_unchecked")
#: What stands in the braces of the sentences.
_LIVE = {
    "n": "g_n",
    "k": "ROUND(g_k,4)",
    "s": 'IF(ISNUMBER(g_sigma0),ROUND(g_sigma0,4),"?")',
    "v": "ROUND(MAX(tblGeo[v]),4)",
    "name": "INDEX(tblGeo[id],MATCH(MAX(tblGeo[v]),tblGeo[v],0))",
    "worst": 'INDEX(tblGeo[id],MATCH("CHECK",tblGeo[fit],0))',
    "off": 'ROUND(INDEX(tblGeo[v],MATCH("CHECK",tblGeo[fit],0)),4)',
}


def world_state_formula(words: Mapping[str, str]) -> str:
    """Return the formula; ``words`` are the sentences by their keys."""
    few, bad, scale, large, good, unchecked = (_live(words[key]) for key in STATES)
    off = f"ABS(g_k-1)>{SCALE_SHARE:g}"
    named = f'IF(COUNTIF(tblGeo[fit],"CHECK")>0,{bad},IF({off},"",{large}))'
    wrong = f'TRIM(IF({off},{scale},"")&" "&{named})'
    right = f'{good}&IF(N(g_spare)<1," "&{unchecked},"")'
    placed = f"IF(ISNUMBER(g_k),IF(g_alarm=1,{wrong},{right}),{few})"
    return f'IF(COUNT(tblGeo[E])=0,"",{placed})'


def _live(sentence: str) -> str:
    """Return a sentence as a formula, what stands in braces as live values."""
    parts = re.split(r"\{(\w+)\}", sentence)
    texts = (f'"{part}"' if i % 2 == 0 else _LIVE[part] for i, part in enumerate(parts))
    return "&".join(text for text in texts if text != '""')
