"""What every route of the server needs: the survey, the body, the answer."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from bifocal.collimation.session import Session


def session_of(request: Request) -> Session:
    """Return the survey."""
    session: Session = request.app.state.session
    return session


async def json_body(request: Request) -> dict[str, Any]:
    """Return the JSON object a request carries.

    Raises
    ------
    HTTPException
        415 or 400 if it carries none.
    """
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json":
        raise HTTPException(415, "expected application/json.")
    try:
        value = json.loads(await request.body(), parse_constant=_no_constant)
    except (ValueError, RecursionError):
        raise HTTPException(400, "the request is not valid JSON.") from None
    if not isinstance(value, dict):
        raise HTTPException(400, "expected a JSON object.")
    return value


def _no_constant(name: str) -> float:
    raise ValueError(name)


def answer(value: Any, status: int = 200) -> Response:
    """Return JSON that no browser keeps."""
    text = json.dumps(value, allow_nan=False)  # ASCII: names of files may hold no characters
    headers = {"cache-control": "no-store"}
    return Response(text, status, headers=headers, media_type="application/json")


async def in_thread(work: Callable[..., Any], *args: Any) -> Any:
    """Return what a function returns that computes, without stopping the other requests."""
    return await run_in_threadpool(partial(work, *args))
