"""Options of commands as they are typed on the page, and where what is made with them goes."""

from __future__ import annotations

from pathlib import Path

from bifocal.collimation.fields import FieldError, Fields
from bifocal.collimation.products import Products
from bifocal.options import OF_PAIR
from photocore.output import free_path


def options_typed(options: Fields, *keys: str) -> dict[str, object]:
    """Return options of a command that are typed on the page, by the command's names.

    Raises
    ------
    FieldError
        If one is not what it has to be.
    """
    settings = {}
    for key in keys:
        option = OF_PAIR["paper" if key == "sheet" else key]
        if options.get(key) in (None, ""):
            continue
        try:
            settings[option.name] = option.typed(options[key])
        except ValueError as error:
            raise FieldError(f"{key}: expected {error}.") from None
    return settings


def delivery_of(products: Products, kind: str, ending: str) -> tuple[Path, bool]:
    """Return the folder of a delivery, and whether the page made it: never over another's."""
    folder, is_ours = products.folder / f"{products.stem}-{ending}", kind in products.made.values()
    if folder.exists() and not is_ours:
        folder = free_path(products.folder, folder.name)
    return folder, is_ours
