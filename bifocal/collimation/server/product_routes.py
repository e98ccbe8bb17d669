"""Routes of photos, jobs and what they make."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Route

from bifocal.collimation.drawing import points_drawing
from bifocal.collimation.fields import FieldError, number_of
from bifocal.collimation.job_tasks import start_job
from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.pictures import Pictures
from bifocal.collimation.product_graph import out_of_date
from bifocal.collimation.server.requests import answer, in_thread, json_body, session_of
from bifocal.collimation.server.streamed_zip import streamed_zip
from bifocal.collimation.session import Session
from bifocal.collimation.shapes import met, places_of, relief_within
from bifocal.collimation.uncertainty import precision_contours, uncertainty_picture
from bifocal.collimation.workbook.profile_book import profile_book, profile_csv
from bifocal.faces import beside
from photocore.arrays import FloatArray, as_points
from photocore.jsonfile import plain
from photocore.output import relative_name

_FRESH = {"cache-control": "no-store"}
#: What writes a profile, and what kind of file that is, by its ending.
_PROFILES = {
    "csv": (profile_csv, "text/csv"),
    "xlsx": (profile_book, "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
}


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
        files = await in_thread(bundle_of, session)
        headers = _attachment(f"{session.files.stem}.zip")
        # How much comes, but for what packing saves: the page shows how far it is.
        headers["x-bytes"] = str(sum(path.stat().st_size for path in files.values()))
        return StreamingResponse(streamed_zip(files), media_type="application/zip", headers=headers)
    if name == "points.dxf":

        def drawing() -> bytes:
            with session.lock:
                return points_drawing(session.state, session.results)

        data = await in_thread(drawing)
        headers = _attachment(f"{session.files.stem}_points.dxf")
        return Response(data, media_type="image/vnd.dxf", headers=headers)
    path = session.products.downloads(session.files.workbook).get(name)
    if path is None:
        raise HTTPException(404, "there is no such file.")
    return FileResponse(path, filename=path.name, headers=_FRESH)


def _attachment(name: str) -> dict[str, str]:
    letters = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in name)
    return {**_FRESH, "content-disposition": f'attachment; filename="{letters}"'}


def bundle_of(session: Session) -> dict[str, Path]:
    """Return all that *Download all* holds: products, workbook, photos and lens files by name."""
    with session.lock:
        more = {}
        for path in session.all_photos:
            inside = path.resolve().is_relative_to(session.files.folder.resolve())
            more[relative_name(path, session.files.folder) if inside else path.name] = path
        pair = session.pictures.pair
        if pair is not None and session.files.pair is not None:
            folder = session.files.pair.parent
            more[session.files.pair.name] = session.files.pair
            for number in (1, 2):
                lens = pair.photo(number).extra.get("lens")
                if isinstance(lens, str) and (folder / lens).is_file():
                    more[Path(lens).name] = folder / lens
            faces = beside(session.files.pair)
            if faces.is_file():
                more[faces.name] = faces
        return session.products.bundle(session.files.workbook, more, out_of_date(session))


async def _overlay(request: Request) -> Response:
    query = dict(request.query_params)
    low, high = number_of(query, "low"), number_of(query, "high")
    data = await in_thread(
        lambda: session_of(request).products.overlay(low, high, hatched="hatched" in query)
    )
    return Response(data, media_type="image/png", headers=_FRESH)


async def _preview(request: Request) -> Response:
    kind = request.path_params["kind"]
    if kind not in ("relief", "ortho", "rectified"):
        raise HTTPException(404, "there is no such picture.")
    data = await in_thread(session_of(request).products.preview, kind)
    return Response(data, media_type="image/png", headers=_FRESH)


async def _value(request: Request) -> Response:
    x, y = (number_of(dict(request.query_params), key) for key in ("X", "Y"))
    if x is None or y is None:
        raise FieldError("X, Y: a place on the wall, in metres.")
    session = session_of(request)

    def value() -> dict[str, object]:
        facts: dict[str, object] = dict(session.products.value(x, y))
        if facts["r"] is not None:
            place = np.array([[x, y, facts["r"]]])
            facts["picks"] = [one[0] for one in session.pictures.needed_pair().project(place)]
        return plain(facts)

    return answer(await in_thread(value))


async def _met(request: Request) -> Response:
    """Where rays of photo 1 meet the relief, and the relief within what they enclose."""
    body = await json_body(request)
    pixels = as_points(body.get("pixels") or [], "pixels", dimension=2).reshape(-1, 2)
    session = session_of(request)

    def find() -> dict[str, object]:
        pair = session.pictures.needed_pair()
        if session.products.current("relief") is None:
            places, within = places_of(pair, np.insert(pixels, 2, 0.0, axis=1).tolist()), None
        else:
            relief = session.products.relief()
            places = met(pair, relief, pixels)
            within = relief_within(pair, relief, pixels) if len(pixels) > 2 else None
        return plain({"places": places, "within": within})

    return answer(await in_thread(find))


async def _profile(request: Request) -> Response:
    body = await json_body(request)
    start, end = (_place(body.get(key) or [], key) for key in ("from", "to"))
    return answer(await in_thread(session_of(request).products.profile, start, end))


async def _profile_file(request: Request) -> Response:
    query = dict(request.query_params)
    ends = [number_of(query, key) for key in ("x0", "y0", "x1", "y1")]
    if None in ends:
        raise FieldError("x0, y0, x1, y1: the ends of the profile on the wall, in metres.")
    start, end = np.array(ends, dtype=float).reshape(2, 2)
    session = session_of(request)

    ending = request.path_params["ending"]
    if ending not in _PROFILES:
        raise HTTPException(404, "there is no such page.")
    write, kind = _PROFILES[ending]

    def written() -> bytes:
        return write(session.products.profile(start, end), start, end, session.files.stem)

    headers = _attachment(f"{session.files.stem}_profile.{ending}")
    return Response(await in_thread(written), media_type=kind, headers=headers)


def _place(typed: ArrayLike, key: str) -> FloatArray:
    place = as_points(typed, key, dimension=2)
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
    Route("/api/jobs", _start, methods=["POST"]),
    Route("/api/jobs/{number}", _cancel, methods=["DELETE"]),
    Route("/download/{name:path}", _download),
    Route("/relief/overlay.png", _overlay),
    Route("/preview/{kind}", _preview),
    Route("/relief/value", _value),
    Route("/relief/met", _met, methods=["POST"]),
    Route("/relief/profile", _profile, methods=["POST"]),
    Route("/relief/profile.{ending}", _profile_file),
    Route("/uncertainty.png", _uncertainty),
    Route("/uncertainty.json", _contours),
]
