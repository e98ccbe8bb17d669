"""The page's server: routes to the session, nothing else."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from bifocal.collimation.fields import COMMANDS, FieldError, fields_of
from bifocal.collimation.server.assets import KEEP, Assets
from bifocal.collimation.server.measuring_routes import ROUTES as MEASURING
from bifocal.collimation.server.product_routes import ROUTES as PRODUCTS
from bifocal.collimation.server.requests import answer, in_thread, json_body, session_of
from bifocal.collimation.server.security import COOKIE, Guard, TooLarge, place_of
from bifocal.collimation.server.state_changes import HELD, StateEditions
from bifocal.collimation.server.state_view import state_of
from bifocal.collimation.server.survey_routes import ROUTES as SURVEYS
from bifocal.collimation.session import Session
from bifocal.remarks import in_language
from photocore.errors import PhotogrammetryError

#: Seconds after which an idle stream of events says that it is alive.
_ALIVE = 15.0


def application(session: Session, token: str) -> Guard:
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
        Route("/tiles/{space}/{image:int}/info", _tile_info),
        Route("/tiles/{space}/{image:int}/{level:int}/{column:int}_{row:int}.jpg", _tile),
        *MEASURING,
        *SURVEYS,
        *PRODUCTS,
        Route("/web/{name:path}", _asset),
        Route("/{name:path}", _asset),
    ]
    app = Starlette(
        routes=routes,
        exception_handlers={
            PhotogrammetryError: _refused, HTTPException: _plain_error,
            TooLarge: _too_large, OSError: _refused, Exception: _fault,
        },
    )  # fmt: skip
    app.state.session, app.state.token, app.state.assets = session, token, Assets()
    app.state.editions = StateEditions()
    return Guard(app, token)  # outside of all: what fails is answered under its rules too


async def _fault(request: Request, error: Exception) -> Response:  # noqa: ARG001
    return answer({"error": f"an error of the program ({type(error).__name__})."}, 500)


async def _refused(request: Request, error: Exception) -> Response:
    spoken = request.app.state.session.spoken
    status = 400 if isinstance(error, FieldError) else 422
    return answer({"error": in_language(str(error), spoken)}, status)


async def _plain_error(request: Request, error: Exception) -> Response:  # noqa: ARG001
    assert isinstance(error, HTTPException)
    return answer({"error": error.detail}, error.status_code)


async def _too_large(request: Request, error: Exception) -> Response:  # noqa: ARG001
    return answer({"error": "the request is too large."}, 413)


async def _page(request: Request) -> Response:
    session = session_of(request)
    text = request.app.state.assets.page(session.spoken)
    response = Response(text, media_type="text/html", headers={"cache-control": "no-store"})
    if "token" in request.query_params:
        token = request.app.state.token
        response.set_cookie(
            COOKIE, token, httponly=True, samesite="strict", path=f"{place_of(token)}/"
        )
    return response


async def _asset(request: Request) -> Response:
    assets: Assets = request.app.state.assets
    return assets.answer(request)


async def _state(request: Request) -> Response:
    def edition() -> dict[str, object]:
        editions: StateEditions = request.app.state.editions
        return editions.next(state_of(session_of(request)), request.headers.get(HELD))

    return answer(await in_thread(edition))


async def _command(request: Request) -> Response:
    session, body = session_of(request), fields_of(await json_body(request), COMMANDS)
    editions: StateEditions = request.app.state.editions

    def carry_out() -> dict[str, object]:
        with session.lock:
            result = session.command(body)
            state = editions.next(state_of(session), request.headers.get(HELD))
            return {"revision": session.revision, "result": result, "state": state}

    return answer(await in_thread(carry_out))


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
    info = session_of(request).pictures.tiles.info(_picture(request))
    if info is None:
        raise HTTPException(404, "there is no such picture.")
    return answer(info)


async def _tile(request: Request) -> Response:
    place = [request.path_params[key] for key in ("level", "column", "row")]
    tile = await in_thread(session_of(request).pictures.tiles.tile, _picture(request), *place)
    if tile is None:
        raise HTTPException(404, "there is no such tile.")
    data, version = tile
    tag = f'"{version}"'
    # A tile asked for without its version may be another one after the next orientation.
    named = request.query_params.get("v") == version
    headers = {"etag": tag, "cache-control": KEEP if named else "private, no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    return Response(data, media_type="image/jpeg", headers=headers)
