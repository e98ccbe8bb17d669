"""The page's address over a crash: after a kill the page that is still open finds its server."""

from __future__ import annotations

import contextlib
import json
import os
import re
from dataclasses import dataclass
from pathlib import Path

from bifocal.collimation.server.security import new_token


@dataclass(frozen=True, slots=True)
class Access:
    """Token and port of a server; the files that keep them are deleted at its orderly end.

    Attributes
    ----------
    path : Path
        Readable for its owner only.
    token : str
    port : int
        Of the last server; 0 if there was none.
    """

    path: Path
    token: str
    port: int = 0

    @classmethod
    def of(cls, path: Path) -> Access:
        """Return what a server that did not end left behind, else a new token."""
        try:
            if os.name != "nt" and path.stat().st_mode & 0o077:
                return cls(path, new_token())
            kept = json.loads(path.read_text(encoding="utf-8"))
            token, port = kept["token"], kept["port"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return cls(path, new_token())
        if not isinstance(port, int) or not re.fullmatch(r"[\w-]{32,99}", str(token), re.ASCII):
            return cls(path, new_token())
        return cls(path, token, port)

    @property
    def page(self) -> Path:
        """A page that leads to the server: the address in a command line all users could read."""
        return self.path.with_suffix(".html")

    def keep(self, port: int, url: str) -> None:
        """Write token and port down; a folder that cannot be written to is none of our worries."""
        content = json.dumps({"token": self.token, "port": port})
        leads = f'<!doctype html><meta http-equiv="refresh" content="0; url={url}">\n'
        with contextlib.suppress(OSError):
            for path, text in ((self.path, content), (self.page, leads)):
                path.unlink(missing_ok=True)
                flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
                with os.fdopen(os.open(path, flags, 0o600), "w", encoding="utf-8") as file:
                    file.write(text)

    def forget(self) -> None:
        """Delete the files."""
        self.path.unlink(missing_ok=True)
        self.page.unlink(missing_ok=True)
