"""A PDF that says what its parts are: headings, paragraphs, tables and figures, for screen readers.

matplotlib draws the pages; what it draws for an artist whose ``gid`` was given by `TaggedPdf.mark`
is marked content of an element of the structure tree (ISO 32000-1, 14.7 and 14.8), all else an
artifact of the layout.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_pdf import Name, PdfFile, RendererPdf, Verbatim

_GID = "marked-"


@dataclass(slots=True, eq=False)
class Element:
    """A part of a document.

    Attributes
    ----------
    tag : str
        Its kind, as PDF names it: ``H1``, ``P``, ``Table``, ``TR``, ``Figure`` and so on.
    alt : str
        Words in place of what is seen.
    kids : list
        Elements, and what is marked on a page: (page, number on it).
    """

    tag: str
    alt: str = ""
    kids: list[Element | tuple[int, int]] = field(default_factory=list)

    def add(self, tag: str, alt: str = "") -> Element:
        """Return a new element within this one."""
        self.kids.append(child := Element(tag, alt))
        return child


class TaggedPdf(PdfFile):  # type: ignore[misc,unused-ignore]
    """A PDF file with a structure tree.

    Parameters
    ----------
    file : path or binary file
    metadata : dict
        As `matplotlib.backends.backend_pdf.PdfFile` takes it.
    language : str
        Of its texts.
    """

    def __init__(self, file: Any, metadata: dict[str, object], language: str) -> None:
        self.language, self.tree = language, Element("Document")
        self._marked: list[list[Element]] = []
        self._tree_object: Any = None
        super().__init__(file, metadata=metadata)

    def mark(self, element: Element) -> str:
        """Return the ``gid`` of an artist on the next page that belongs to an element."""
        page = len(self.pageList)
        while len(self._marked) <= page:
            self._marked.append([])
        number = len(self._marked[page])
        self._marked[page].append(element)
        element.kids.append((page, number))
        return f"{_GID}{number}/{element.tag}"

    def add_page(self, figure: Any) -> None:
        """Draw a figure as the next page."""
        dpi, figure.dpi = figure.dpi, 72  # points to an inch
        width, height = figure.get_size_inches()
        self.newPage(width, height)
        renderer = MixedModeRenderer(
            figure, width, height, dpi, _TaggingRenderer(self, dpi, height, width)
        )
        figure.draw(renderer)
        renderer.finalize()
        self.endStream()

    def writeObject(self, object: Any, contents: Any) -> None:
        """Write an object; catalog and pages lead to the structure tree."""
        kind = contents.get("Type") if isinstance(contents, dict) else None
        if kind == Name("Catalog"):
            self._tree_object = self.reserveObject("structure tree")
            contents = contents | {
                "Lang": self.language, "MarkInfo": {"Marked": True},
                "StructTreeRoot": self._tree_object,
                "ViewerPreferences": {"DisplayDocTitle": True},
            }  # fmt: skip
        elif kind == Name("Page"):
            contents = contents | {"StructParents": len(self.pageList), "Tabs": Name("S")}
        super().writeObject(object, contents)

    def finalize(self) -> None:
        """Write the structure tree and the end of the file."""
        objects: dict[Element, object] = {}
        self._write_element(self.tree, self._tree_object, objects)
        parents = []
        for page, marked in enumerate(self._marked):
            parents += [page, [objects[element] for element in marked]]
        root = {
            "Type": Name("StructTreeRoot"), "K": objects[self.tree],
            "ParentTree": {"Nums": parents}, "ParentTreeNextKey": len(self._marked),
        }  # fmt: skip
        super().writeObject(self._tree_object, root)
        super().finalize()

    def _write_element(self, element: Element, parent: Any, objects: dict[Element, object]) -> None:
        number = objects[element] = self.reserveObject("structure element")
        content = {
            "Type": Name("StructElem"), "S": Name(element.tag), "P": parent,
            "K": list(self._kids(element, number, objects)),
        }  # fmt: skip
        if element.alt:
            content["Alt"] = element.alt
        if element.tag == "TH":
            content["A"] = {"O": Name("Table"), "Scope": Name("Column")}
        super().writeObject(number, content)

    def _kids(self, element: Element, own: Any, objects: dict[Element, object]) -> Iterator[Any]:
        for kid in element.kids:
            if isinstance(kid, Element):
                self._write_element(kid, own, objects)
                yield objects[kid]
            else:
                page, number = kid
                yield {"Type": Name("MCR"), "Pg": self.pageList[page], "MCID": number}


class _TaggingRenderer(RendererPdf):  # type: ignore[misc,unused-ignore]
    """Marks what is drawn for an artist: content of an element, or an artifact."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._groups: list[bool] = []

    def open_group(self, s: str, gid: str | None = None) -> None:
        """Begin what an artist draws."""
        begins = not any(self._groups) and s != "figure"
        self._groups.append(begins)
        if begins and gid and gid.startswith(_GID):
            number, _, tag = gid.removeprefix(_GID).partition("/")
            self.file.output(Name(tag), {"MCID": int(number)}, Verbatim(b"BDC"))
        elif begins:
            self.file.output(Name("Artifact"), Verbatim(b"BMC"))

    def close_group(self, s: str) -> None:  # noqa: ARG002
        """End it."""
        if self._groups.pop():
            self.file.output(Verbatim(b"EMC"))
