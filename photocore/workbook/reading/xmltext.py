"""Text as XML holds it.

`xml.sax.saxutils` does the same, but loads the modules of the network: a tenth of a second.
"""

from __future__ import annotations

import html


def escaped(text: str) -> str:
    """Return a text for an element.

    >>> escaped("a < b")
    'a &lt; b'
    """
    return html.escape(text, quote=False)


def quoted(text: str) -> str:
    """Return a text as the value of an attribute, with its quotes.

    >>> quoted('6"')
    '"6&quot;"'
    """
    text = escaped(text).replace('"', "&quot;")
    for mark in "\n\r\t":
        text = text.replace(mark, f"&#{ord(mark)};")
    return f'"{text}"'


def unescaped(text: str) -> str:
    """Return the text that stands in an element.

    >>> unescaped("a &lt; b")
    'a < b'
    """
    return html.unescape(text)
