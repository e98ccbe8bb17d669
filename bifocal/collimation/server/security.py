"""Who may talk to the server: its own page, with its token, in requests of bounded size."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Mapping
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bifocal.collimation.wording import say
from photocore.workbook import LANGUAGES

#: Bodies of commands, and of two dropped photos. [bytes]
LARGEST_COMMAND, LARGEST_PHOTOS = 1 << 20, 1 << 30
UPLOAD = "/api/photos"
LONGEST_PATH = 1000
_HEADERS: Mapping[str, str] = {
    "content-security-policy": (
        "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; base-uri 'none'; "
        "form-action 'self'; frame-ancestors 'none'; object-src 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


#: Name of the cookie that holds the token.
COOKIE = "bifocal_token"


def place_of(token: str) -> str:
    """Return the path under which a server's page lies, which nobody can guess.

    A browser sends the cookies of one port to the servers of all others, but never to another path.
    """
    return f"/{hashlib.sha256(f'page of {token}'.encode()).hexdigest()[:32]}"


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(32)


class Guard:
    """ASGI middleware that lets nothing through but the page's own requests.

    Parameters
    ----------
    app : ASGI application
    token : str
        What every request has to know.

    Notes
    -----
    A foreign page in the same browser is stopped by its Origin, a name that was bent to 127.0.0.1
    by its Host, another user of the computer by the token. Answers carry no CORS header. The page
    lies under a path of its own, where its cookie is taken; elsewhere only a token that is named.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app, self.token, self.place = app, token, place_of(token)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.app(scope, receive, send)
            return
        at_page = scope["path"].startswith(f"{self.place}/")
        if at_page:
            scope = {**scope, "path": scope["path"].removeprefix(self.place)}
        refusal = self._refusal(scope, at_page=at_page)
        if refusal is not None:
            await _answer(scope, *refusal)(scope, receive, _with_headers(send))
            return
        if scope["path"] == "/" and not at_page:
            moved = RedirectResponse(f"{self.place}/?token={self.token}", 303)
            await moved(scope, receive, _with_headers(send))
            return
        limit = LARGEST_PHOTOS if scope["path"] == UPLOAD else LARGEST_COMMAND
        await self.app(scope, _limited(receive, limit), _with_headers(send))

    def _refusal(self, scope: Scope, *, at_page: bool) -> tuple[int, str] | None:
        """Return status and reason where a request is refused."""
        headers = Headers(scope=scope)
        server = scope.get("server") or ("127.0.0.1", 0)
        hosts = {f"127.0.0.1:{server[1]}", f"localhost:{server[1]}"}
        if headers.getlist("host")[1:] or headers.get("host") not in hosts:
            return 403, "this address is not the page's."
        origins = {f"http://{host}" for host in hosts}
        if any(origin not in origins for origin in headers.getlist("origin")):
            return 403, "another page may not use this server."
        query = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [])
        # A file of the user's own that knows the token may open the page, and nothing else.
        opens = scope["path"] == "/" and self._is_token(*query)
        foreign = headers.get("sec-fetch-site", "none") not in ("same-origin", "none")
        if foreign and not (opens and headers.get("sec-fetch-mode") == "navigate"):
            return 403, "another page may not use this server."
        cookies = _cookies_in(headers) if at_page else []
        if not self._is_token(*query, headers.get("x-bifocal-token", ""), *cookies):
            return 403, "open the page with the address that `bifocal pick` printed."
        if len(scope["path"]) > LONGEST_PATH:
            return 414, "the address is too long."
        try:
            length = int(headers.get("content-length") or 0)
        except ValueError:
            return 400, "content-length is no number."
        limit = LARGEST_PHOTOS if scope["path"] == UPLOAD else LARGEST_COMMAND
        if length > limit:
            return 413, f"more than {limit // 2**20} MB are not taken."
        return None

    def _is_token(self, *given: str) -> bool:
        token = self.token.encode()
        return any(hmac.compare_digest(word.encode("utf-8", "replace"), token) for word in given)


def _cookies_in(headers: Headers) -> list[str]:
    """Return the tokens that cookies name: another server may have set one of the same name."""
    pairs = (pair.strip().partition("=") for pair in headers.get("cookie", "").split(";"))
    return [value for name, _, value in pairs if name == COOKIE]


def _answer(scope: Scope, status: int, text: str) -> Response:
    """Return a refusal: to a person a page, to a program JSON."""
    headers = Headers(scope=scope)
    if "text/html" not in headers.get("accept", ""):
        return JSONResponse({"error": text}, status)
    preferred = headers.get("accept-language", "")[:2]
    language = preferred if preferred in LANGUAGES else "en"
    return HTMLResponse(
        f'<!doctype html><html lang="{language}"><meta charset="utf-8"><title>bifocal</title>'
        f"<h1>bifocal</h1><p>{say('ask', 'token', language)}</p><p><small>{text}</small></p>",
        status,
    )


class TooLarge(Exception):
    """A body without length turned out larger than is taken."""


def _limited(receive: Receive, limit: int) -> Receive:
    """Return the body's source, cut off where it grows beyond the limit."""
    received = 0

    async def receive_limited() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if received > limit:
            raise TooLarge
        return message

    return receive_limited


def _with_headers(send: Send) -> Send:
    """Return the answer's sink, adding what every answer carries."""

    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers[name] = value
        await send(message)

    return send_with_headers
