"""The page's address over a crash: after a kill the page that is still open finds its server."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

from bifocal.collimation.security import new_token


@dataclass(frozen=True, slots=True)
class Access:
    """Token and port of a server; the file that keeps them is deleted at its orderly end.

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
        except (OSError, ValueError, KeyError, TypeError):
            return cls(path, new_token())
        if not (isinstance(token, str) and len(token) >= 32 and isinstance(port, int)):
            return cls(path, new_token())
        return cls(path, token, port)

    def keep(self, port: int) -> None:
        """Write token and port down; a folder that cannot be written to is none of our worries."""
        try:
            self.path.unlink(missing_ok=True)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
            with os.fdopen(os.open(self.path, flags, 0o600), "w", encoding="utf-8") as file:
                json.dump({"token": self.token, "port": port}, file)
        except OSError:
            return

    def forget(self) -> None:
        """Delete the file."""
        self.path.unlink(missing_ok=True)
