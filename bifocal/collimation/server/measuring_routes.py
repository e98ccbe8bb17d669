"""Routes that measure: suggestion, line, snap, distances, conversion of pixels."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from bifocal.collimation.asked import measured
from bifocal.collimation.fields import FieldError, image_of, pixel_of, positive_of
from bifocal.collimation.server.requests import answer, in_thread, json_body, session_of
from photocore.arrays import as_points
from photocore.jsonfile import plain


async def _suggest(request: Request) -> Response:
    body = await json_body(request)
    image, pixel = image_of(body), pixel_of(body)
    return answer(await in_thread(session_of(request).pictures.suggest, image, pixel))


async def _line(request: Request) -> Response:
    body = await json_body(request)
    image, pixel = image_of(body), pixel_of(body)
    return answer({"line": await in_thread(session_of(request).pictures.line, image, pixel)})


async def _snap(request: Request) -> Response:
    body = await json_body(request)
    image, pixel, radius = image_of(body), pixel_of(body), positive_of(body, "radius")
    return answer(await in_thread(session_of(request).pictures.snap, image, pixel, radius or 8.0))


async def _measure(request: Request) -> Response:
    names = (await json_body(request)).get("points")
    if not isinstance(names, list) or len(names) > 1000:
        raise FieldError("points: expected a list of names.")
    return answer(await in_thread(measured, session_of(request), [str(name) for name in names]))


async def _convert(request: Request) -> Response:
    body = await json_body(request)
    source = body.get("from", "photo")
    if source not in ("photo", "wall"):
        raise FieldError("from: photo or wall.")
    pixels = as_points(body.get("pixels") or [], "pixels", dimension=2)
    if pixels.ndim != 2:
        raise FieldError("pixels: expected a list of [column, row].")
    session = session_of(request)
    moved = await in_thread(session.pictures.convert, image_of(body), pixels, source)
    return answer({"pixels": plain(moved)})


ROUTES = [
    Route("/api/suggest", _suggest, methods=["POST"]),
    Route("/api/line", _line, methods=["POST"]),
    Route("/api/snap", _snap, methods=["POST"]),
    Route("/api/measure", _measure, methods=["POST"]),
    Route("/api/convert", _convert, methods=["POST"]),
]
