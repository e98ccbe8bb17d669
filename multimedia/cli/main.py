"""The ``multimedia`` command."""

from __future__ import annotations

import click

from photocore.cli import LazyGroup
from photocore.installation import DISTRIBUTION
from photocore.options import program


@click.group(cls=LazyGroup, commands_package="multimedia.cli", **program("multimedia"))
@click.version_option(package_name=DISTRIBUTION, prog_name="multimedia")
def main() -> None:
    """Photogrammetry through air, glass and water."""
