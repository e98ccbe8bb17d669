"""Routes that begin a survey: its photos, the sample, walls at hand, what was open before."""

from __future__ import annotations

from pathlib import Path

from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from bifocal.collimation.fields import number_of
from bifocal.collimation.server.requests import answer, in_thread, json_body, session_of
from bifocal.collimation.server.state_view import state_of
from bifocal.collimation.server.uploads import MOST, take_photos
from bifocal.collimation.starting import open_sample, open_wall, recent, reopen, walls_at_hand


async def _photos(request: Request) -> Response:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "multipart/form-data":
        raise HTTPException(415, "expected multipart/form-data.")
    session = session_of(request)
    async with request.form(max_files=MOST, max_fields=MOST) as form:
        sent = [form.get(f"photo{number}") for number in range(1, MOST + 1)]
        files = [(each.filename or "", each.file) for each in sent if isinstance(each, UploadFile)]

        def take() -> dict[str, object]:
            present = session.all_photos
            further = len(present) > 1 and len(files) == 1
            if not further:
                session.check_new_photos()
            photos = take_photos(session.files.folder, files, present)
            if further:
                session.give_others(photos[2:])
            else:
                session.give_photos(photos)
            return state_of(session)

        return answer(await in_thread(take))


async def _take_away(request: Request) -> Response:
    """Let a photo beside far and near go; its file stays where it is."""
    session, number = session_of(request), request.path_params["number"]
    photos = [p for n, p in enumerate(session.all_photos, start=1) if n > 2 and n != number]
    await in_thread(session.give_others, photos)
    return answer(await in_thread(state_of, session))


async def _sample(request: Request) -> Response:
    session = session_of(request)
    await in_thread(open_sample, session)
    return answer(await in_thread(state_of, session))


async def _walls(request: Request) -> Response:
    return answer({"walls": await in_thread(walls_at_hand, session_of(request))})


async def _wall(request: Request) -> Response:
    session, number = session_of(request), number_of(await json_body(request), "number")
    await in_thread(open_wall, session, 0 if number is None else int(number))
    return answer(await in_thread(state_of, session))


async def _recent(request: Request) -> Response:
    """Name the surveys that were open before: their folders and names, no more."""
    names = [Path(name) for name in await in_thread(recent)]
    workbook = session_of(request).files.workbook.resolve()
    shown = [
        {"number": number, "name": path.stem, "folder": path.parent.name}
        for number, path in enumerate(names)
        if path != workbook
    ]
    return answer({"surveys": shown})


async def _reopen(request: Request) -> Response:
    number = number_of(await json_body(request), "number")
    return answer({"url": await in_thread(reopen, -1 if number is None else int(number))})


ROUTES = [
    Route("/api/photos", _photos, methods=["POST"]),
    Route("/api/photos/{number:int}", _take_away, methods=["DELETE"]),
    Route("/api/sample", _sample, methods=["POST"]),
    Route("/api/walls", _walls),
    Route("/api/walls", _wall, methods=["POST"]),
    Route("/api/recent", _recent),
    Route("/api/recent", _reopen, methods=["POST"]),
]
