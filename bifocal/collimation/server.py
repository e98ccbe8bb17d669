"""The page's server: routes to the session, nothing else."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from bifocal.collimation.commands import image_of, pixel_of, positive_of
from bifocal.collimation.security import COOKIE, Guard, TooLarge
from bifocal.collimation.session import Session
from bifocal.collimation.state_view import state_of
from photocore.arrays import as_points
from photocore.errors import InputError, PhotogrammetryError
from photocore.jsonfile import plain

#: The page itself.
WEB = Path(__file__).parent / "web"
#: Pictures are named with their version, so a browser need not ask again.
_KEEP = "private, max-age=31536000, immutable"
#: Seconds after which an idle stream of events says that it is alive.
_ALIVE = 15.0


def application(session: Session, token: str) -> Starlette:
    """Return the page's server for a survey.

    Parameters
    ----------
    session : Session
    token : str
        Every request has to know it.
    """
    routes = [
        Route("/", _page),
        Route("/api/state", _state),
        Route("/api/events", _events),
        Route("/api/command", _command, methods=["POST"]),
        Route("/api/suggest", _suggest, methods=["POST"]),
        Route("/api/line", _line, methods=["POST"]),
        Route("/api/snap", _snap, methods=["POST"]),
        Route("/api/measure", _measure, methods=["POST"]),
        Route("/api/convert", _convert, methods=["POST"]),
        Route("/tiles/{space}/{image:int}/info", _tile_info),
        Route("/tiles/{space}/{image:int}/{level:int}/{column:int}_{row:int}.jpg", _tile),
        Mount("/", StaticFiles(directory=WEB)),
    ]
    app = Starlette(
        routes=routes,
        middleware=[Middleware(Guard, token=token)],
        exception_handlers={
            PhotogrammetryError: _refused, HTTPException: _plain_error, TooLarge: _too_large,
        },
    )  # fmt: skip
    app.state.session, app.state.token = session, token
    return app


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
    return JSONResponse(value, status, headers={"cache-control": "no-store"})


async def in_thread(work: Callable[..., Any], *args: Any) -> Any:
    """Return what a function returns that computes, without stopping the other requests."""
    return await run_in_threadpool(partial(work, *args))


async def _refused(request: Request, error: Exception) -> Response:  # noqa: ARG001
    return answer({"error": str(error)}, 422)


async def _plain_error(request: Request, error: Exception) -> Response:  # noqa: ARG001
    assert isinstance(error, HTTPException)
    return answer({"error": error.detail}, error.status_code)


async def _too_large(request: Request, error: Exception) -> Response:  # noqa: ARG001
    return answer({"error": "the request is too large."}, 413)


async def _page(request: Request) -> Response:
    text = (WEB / "index.html").read_bytes()
    response = Response(text, media_type="text/html", headers={"cache-control": "no-store"})
    if "token" in request.query_params:
        response.set_cookie(
            COOKIE, request.app.state.token, httponly=True, samesite="strict", path="/"
        )
    return response


async def _state(request: Request) -> Response:
    return answer(await in_thread(state_of, session_of(request)))


async def _command(request: Request) -> Response:
    session, body = session_of(request), await json_body(request)

    def carry_out() -> dict[str, Any]:
        with session.lock:
            result = session.command(body)
            return {"revision": session.revision, "result": result, "state": state_of(session)}

    return answer(await in_thread(carry_out))


async def _suggest(request: Request) -> Response:
    body = await json_body(request)
    image, pixel = image_of(body), pixel_of(body)
    return answer(await in_thread(session_of(request).suggest, image, pixel))


async def _line(request: Request) -> Response:
    body = await json_body(request)
    image, pixel = image_of(body), pixel_of(body)
    return answer({"line": await in_thread(session_of(request).line, image, pixel)})


async def _snap(request: Request) -> Response:
    body = await json_body(request)
    image, pixel, radius = image_of(body), pixel_of(body), positive_of(body, "radius")
    return answer(await in_thread(session_of(request).snap, image, pixel, radius or 8.0))


async def _measure(request: Request) -> Response:
    names = (await json_body(request)).get("points")
    if not isinstance(names, list) or len(names) > 1000:
        raise InputError("points: expected a list of names.")
    return answer(await in_thread(session_of(request).measure, [str(name) for name in names]))


async def _convert(request: Request) -> Response:
    body = await json_body(request)
    source = body.get("from", "photo")
    if source not in ("photo", "wall"):
        raise InputError("from: photo or wall.")
    pixels = as_points(body.get("pixels") or [], "pixels", dimension=2)
    if pixels.ndim != 2:
        raise InputError("pixels: expected a list of [column, row].")
    session = session_of(request)
    moved = await in_thread(session.convert, image_of(body), pixels, source)
    return answer({"pixels": plain(moved)})


async def _events(request: Request) -> Response:
    session = session_of(request)
    events, leave = session.listen()

    async def stream() -> AsyncIterator[str]:
        waited = 0.0
        try:
            yield f"data: {json.dumps({'revision': session.revision})}\n\n"
            while not await request.is_disconnected():
                if events.empty():
                    await asyncio.sleep(0.05)
                    waited += 0.05
                    if waited > _ALIVE:
                        waited = 0.0
                        yield ": alive\n\n"
                    continue
                event = events.get()
                if event is None:
                    return
                yield f"data: {json.dumps(event)}\n\n"
        finally:
            leave()

    headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
    return StreamingResponse(stream(), media_type="text/event-stream", headers=headers)


def _picture(request: Request) -> str:
    return f"{request.path_params['space']}-{request.path_params['image']}"


async def _tile_info(request: Request) -> Response:
    info = session_of(request).tiles.info(_picture(request))
    if info is None:
        raise HTTPException(404, "there is no such picture.")
    return answer(info)


async def _tile(request: Request) -> Response:
    place = [request.path_params[key] for key in ("level", "column", "row")]
    tile = await in_thread(session_of(request).tiles.tile, _picture(request), *place)
    if tile is None:
        raise HTTPException(404, "there is no such tile.")
    data, version = tile
    tag = f'"{version}"'
    # A tile asked for without its version may be another one after the next orientation.
    named = request.query_params.get("v") == version
    headers = {"etag": tag, "cache-control": _KEEP if named else "private, no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(data, media_type="image/jpeg", headers=headers)
