"""Routes of photos, jobs and what they make."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from bifocal.collimation.drawing import points_drawing
from bifocal.collimation.fields import FieldError, number_of
from bifocal.collimation.job_tasks import start_job
from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.pictures import Pictures
from bifocal.collimation.server.requests import answer, in_thread, json_body, session_of
from bifocal.collimation.server.state_view import state_of
from bifocal.collimation.server.uploads import take_photos
from bifocal.collimation.uncertainty import precision_contours, uncertainty_picture
from photocore.arrays import FloatArray, as_points

_FRESH = {"cache-control": "no-store"}


async def _photos(request: Request) -> Response:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "multipart/form-data":
        raise HTTPException(415, "expected multipart/form-data.")
    session = session_of(request)
    async with request.form(max_files=2, max_fields=2) as form:
        sent = [form.get(name) for name in ("photo1", "photo2")]
        files = [(each.filename or "", each.file) for each in sent if isinstance(each, UploadFile)]

        def take() -> dict[str, Any]:
            session.check_new_photos()
            there = [info.path for info in session.pictures.infos]
            session.give_photos(take_photos(session.files.folder, files, there))
            return state_of(session)

        return answer(await in_thread(take))


async def _start(request: Request) -> Response:
    body = await json_body(request)
    options = body.get("options", body)
    if not isinstance(options, dict):
        raise FieldError("options: expected an object.")
    job = await in_thread(start_job, session_of(request), str(body.get("kind")), options)
    return answer({"id": job.number})


async def _cancel(request: Request) -> Response:
    await in_thread(session_of(request).jobs.cancel, request.path_params["number"])
    return answer({})


async def _download(request: Request) -> Response:
    session, name = session_of(request), request.path_params["name"]
    if name == "all.zip":
        data = await in_thread(session.products.zipped, session.files.workbook)
        return _attached(data, "application/zip", f"{session.files.stem}.zip")
    if name == "points.dxf":

        def drawing() -> bytes:
            with session.lock:
                return points_drawing(session.state, session.results)

        data = await in_thread(drawing)
        return _attached(data, "image/vnd.dxf", f"{session.files.stem}_points.dxf")
    path = session.products.downloads(session.files.workbook).get(name)
    if path is None:
        raise HTTPException(404, "there is no such file.")
    return FileResponse(path, filename=path.name, headers=_FRESH)


def _attached(data: bytes, kind: str, name: str) -> Response:
    letters = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in name)
    headers = {**_FRESH, "content-disposition": f'attachment; filename="{letters}"'}
    return Response(data, media_type=kind, headers=headers)


async def _overlay(request: Request) -> Response:
    data = await in_thread(session_of(request).products.overlay)
    return Response(data, media_type="image/png", headers=_FRESH)


async def _value(request: Request) -> Response:
    x, y = (number_of(dict(request.query_params), key) for key in ("X", "Y"))
    if x is None or y is None:
        raise FieldError("X, Y: a place on the wall, in metres.")
    return answer(await in_thread(session_of(request).products.value, x, y))


async def _profile(request: Request) -> Response:
    body = await json_body(request)
    start, end = (_place(body, key) for key in ("from", "to"))
    return answer(await in_thread(session_of(request).products.profile, start, end))


def _place(body: dict[str, Any], key: str) -> FloatArray:
    place = as_points(body.get(key) or [], key, dimension=2)
    if place.ndim != 1:
        raise FieldError(f"{key}: expected [X, Y] in metres.")
    return place


async def _of_precision(request: Request, work: Callable[[Pictures, LiveResults], Any]) -> Any:
    session = session_of(request)
    session.pictures.needed_pair()
    return await in_thread(lambda: work(session.pictures, cast(LiveResults, session.results)))


async def _uncertainty(request: Request) -> Response:
    data = await _of_precision(request, uncertainty_picture)
    return Response(data, media_type="image/png", headers=_FRESH)


async def _contours(request: Request) -> Response:
    return answer(await _of_precision(request, precision_contours))


ROUTES = [
    Route("/api/photos", _photos, methods=["POST"]),
    Route("/api/jobs", _start, methods=["POST"]),
    Route("/api/jobs/{number}", _cancel, methods=["DELETE"]),
    Route("/download/{name:path}", _download),
    Route("/relief/overlay.png", _overlay),
    Route("/relief/value", _value),
    Route("/relief/profile", _profile, methods=["POST"]),
    Route("/uncertainty.png", _uncertainty),
    Route("/uncertainty.json", _contours),
]
