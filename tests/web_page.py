"""A page as a browser or a validator reads it: closed in order, without an error of HTML."""

from __future__ import annotations

from html.parser import HTMLParser

_VOID = {"meta", "img", "input", "link", "br", "hr"}


class Page(HTMLParser):
    """Checks that elements are closed in order, and gathers what a reader sees."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.sources: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open
        self._validate(text)

    @staticmethod
    def _validate(text: str) -> None:
        """Read it as the HTML standard says, where the parser that reports errors is installed."""
        try:
            import html5lib
        except ImportError:
            return
        html5lib.HTMLParser(strict=True).parse(text)

    def handle_starttag(self, tag, attrs):
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names))
        if tag not in _VOID:
            self.open.append(tag)
        if tag == "img":
            assert dict(attrs)["alt"]
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return "\n".join(self.words)
