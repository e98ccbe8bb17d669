"""The page's own files, kept in memory and compressed once."""

from __future__ import annotations

import gzip
import hashlib
from functools import cache
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

#: The page itself.
WEB = Path(__file__).parents[1] / "web"
#: What a name with its version or digest shows never changes.
KEEP = "private, max-age=31536000, immutable"
_TYPES = {
    ".css": "text/css", ".html": "text/html", ".js": "text/javascript", ".md": "text/plain",
    ".svg": "image/svg+xml",
}  # fmt: skip
_MODULES = b"<!-- modules -->"


class Assets:
    """Scripts, styles and words of the page."""

    def __init__(self) -> None:
        paths = [path for path in sorted(WEB.rglob("*")) if path.suffix in _TYPES]
        self._files = {path.relative_to(WEB).as_posix(): path.read_bytes() for path in paths}
        self._tags = {
            name: f'"{hashlib.sha256(data).hexdigest()[:16]}"' for name, data in self._files.items()
        }

    def page(self, language: str) -> bytes:
        """Return the page; it names all modules, so that the browser fetches them side by side.

        Otherwise it learns of each one only from the module that imports it, four deep.
        """
        words = {f"js/words/{name}.js" for name in ("words", language)}
        scripts = {name for name in self._files if name.endswith(".js")}
        names = sorted(name for name in scripts if "/words/" not in name or name in words)
        links = "".join(f'<link rel="modulepreload" href="{name}">\n' for name in names)
        return self._files["index.html"].replace(_MODULES, links.encode())

    def answer(self, request: Request) -> Response:
        """Return the file that a request names; of others it knows nothing.

        Raises
        ------
        HTTPException
            404 if there is none.
        """
        name = request.path_params["name"]
        data = self._files.get(name)
        if data is None:
            raise HTTPException(404, "there is no such page.")
        headers = {"etag": self._tags[name], "cache-control": "private, no-cache"}
        headers["vary"] = "accept-encoding"
        if request.headers.get("if-none-match") == headers["etag"]:
            return Response(status_code=304, headers=headers)
        if "gzip" in request.headers.get("accept-encoding", ""):
            data, headers["content-encoding"] = _compressed(data), "gzip"
        return Response(data, media_type=_TYPES[Path(name).suffix], headers=headers)


@cache
def _compressed(data: bytes) -> bytes:
    return gzip.compress(data, mtime=0)
