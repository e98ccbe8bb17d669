"""From files to a page in the browser."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import uvicorn

from bifocal.collimation.first_orientation import FirstOrientation
from bifocal.collimation.project import find_files
from bifocal.collimation.server.access import Access
from bifocal.collimation.server.application import application
from bifocal.collimation.server.security import place_of
from bifocal.collimation.session import Session
from bifocal.collimation.starting import remember
from photocore.errors import InputError, PhotogrammetryError
from photocore.interrupts import raising

HOST = "127.0.0.1"
#: After the first paint, from kept tiles, the photos are read for suggestion and snap. [s]
WARM_UP = 1.5


@dataclass(frozen=True, slots=True)
class PageServer:
    """A server of the page, listening.

    Attributes
    ----------
    url : str
        Address of the page, token included.
    token : str
    session : Session
    """

    url: str
    token: str
    session: Session
    _server: uvicorn.Server
    _socket: socket.socket
    _page: Path

    def open_browser(self) -> None:
        """Open the page in the browser, as soon as the server answers."""
        url = self._page.absolute().as_uri() if self._page.is_file() else self.url
        threading.Timer(0.3, webbrowser.open, [url]).start()

    def serve(self) -> None:
        """Answer requests until the server is stopped."""
        with contextlib.suppress(KeyboardInterrupt):
            self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """Let `serve` come to its end."""
        self.session.tell(None)
        self._server.should_exit = True


@contextmanager
def page_server(
    *sources: Path | str, workbook: Path | str | None = None, port: int = 0, language: str = "en"
) -> Iterator[PageServer]:
    """Yield a server for the page of a survey, listening but not yet answering.

    Parameters
    ----------
    sources : path
        A pair file, a survey workbook, a folder, or two photos (far, near).
    workbook : path, optional
        Where the points go; default a workbook named after the pair.
    port : int
        0: any that is free.
    language : {"en", "it", "de"}
        Of the page.

    Yields
    ------
    PageServer
        Its address and the session behind it.

    Raises
    ------
    InputError
        If the files are unusable, or the port is taken.
    """
    files = find_files([Path(s) for s in sources], None if workbook is None else Path(workbook))
    access = Access.of(files.folder / f".{files.stem}.page.json")
    with raising(), _listening(port, access.port) as listening:
        number = listening.getsockname()[1]
        url = f"http://{HOST}:{number}{place_of(access.token)}/?token={access.token}"
        session = Session(files, language=language)
        warm = threading.Timer(WARM_UP, _warm_up, [session])
        warm.daemon = True
        try:
            config = uvicorn.Config(
                application(session, access.token), log_level="critical", access_log=False,
                lifespan="off", server_header=False, timeout_graceful_shutdown=1,
            )  # fmt: skip
            access.keep(number, url)
            session.sync.start()
            warm.start()
            FirstOrientation(session).start()
            yield PageServer(
                url, access.token, session, uvicorn.Server(config), listening, access.page
            )
        finally:
            warm.cancel()
            access.forget()
            # OpenCV, reading a photo when Python ends, would abort the process.
            if warm.is_alive():
                warm.join()
            session.close()


def _warm_up(session: Session) -> None:
    """Read both photos meanwhile; what is wrong with them is said where they are asked for."""
    with contextlib.suppress(PhotogrammetryError, OSError, MemoryError):
        session.pictures.warm_up()


def pick(
    *sources: Path | str,
    workbook: Path | str | None = None,
    port: int = 0,
    language: str = "en",
    browser: bool = True,
) -> None:
    """Open the page of a survey in the browser; return when it is stopped (Ctrl-C).

    Parameters
    ----------
    sources, workbook, port, language
        As `page_server`.
    browser : bool
        Whether to open the browser.

    Raises
    ------
    InputError
        If the files are unusable, or the port is taken.
    """
    with page_server(*sources, workbook=workbook, port=port, language=language) as server:
        if browser:
            remember(server.session.files)
            server.open_browser()
        server.serve()


@contextmanager
def _listening(port: int, last: int) -> Iterator[socket.socket]:
    """Yield a socket on this computer only; the last one's port where none is asked for."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listening:
        if os.name != "nt":  # there it would let two servers share one port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, port or last))
        except (OSError, OverflowError) as error:
            if port:
                reason = getattr(error, "strerror", None) or error
                raise InputError(
                    f"port {port} cannot be used ({reason}); leave --port out and one is found."
                ) from None
            listening.bind((HOST, 0))
        listening.listen(256)  # a browser that is quicker than the server waits
        yield listening
