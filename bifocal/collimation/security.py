"""Who may talk to the server: its own page, with its token, in requests of bounded size."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Bodies of commands, and of two dropped photos. [bytes]
LARGEST_COMMAND, LARGEST_PHOTOS = 1 << 20, 1 << 30
UPLOAD = "/api/photos"
COOKIE = "bifocal_token"
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
    by its Host, another user of the computer by the token. Answers carry no CORS header.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self.app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is not None:
            status, text = refusal
            await JSONResponse({"error": text}, status)(scope, receive, _with_headers(send))
            return
        limit = LARGEST_PHOTOS if scope["path"] == UPLOAD else LARGEST_COMMAND
        await self.app(scope, _limited(receive, limit), _with_headers(send))

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Return status and reason where a request is refused."""
        headers = Headers(scope=scope)
        server = scope.get("server") or ("127.0.0.1", 0)
        hosts = {f"127.0.0.1:{server[1]}", f"localhost:{server[1]}"}
        if headers.getlist("host")[1:] or headers.get("host") not in hosts:
            return 403, "this address is not the page's."
        origins = {f"http://{host}" for host in hosts}
        if any(origin not in origins for origin in headers.getlist("origin")):
            return 403, "another page may not use this server."
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return 403, "another page may not use this server."
        if not self._knows_token(scope, headers):
            return 403, "open the page with the address that `bifocal pick` printed."
        try:
            length = int(headers.get("content-length") or 0)
        except ValueError:
            return 400, "content-length is no number."
        limit = LARGEST_PHOTOS if scope["path"] == UPLOAD else LARGEST_COMMAND
        if length > limit:
            return 413, f"more than {limit // 2**20} MB are not taken."
        return None

    def _knows_token(self, scope: Scope, headers: Headers) -> bool:
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        cookies = SimpleCookie()
        try:
            cookies.load(headers.get("cookie", ""))
        except CookieError:
            cookies = SimpleCookie()
        given = [
            *query.get("token", []),
            headers.get("x-bifocal-token", ""),
            *[morsel.value for name, morsel in cookies.items() if name == COOKIE],
        ]
        known = self.token.encode()
        return any(hmac.compare_digest(word.encode("utf-8", "replace"), known) for word in given)


class TooLarge(Exception):
    """A body without length turned out larger than is taken."""


def _limited(receive: Receive, limit: int) -> Receive:
    """Return the body's source, cut off where it grows beyond the limit."""
    taken = 0

    async def receive_limited() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > limit:
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
