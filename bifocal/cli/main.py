"""The ``bifocal`` command."""

from __future__ import annotations

import click

from photocore.cli import LazyGroup
from photocore.installation import DISTRIBUTION
from photocore.options import program


@click.group(cls=LazyGroup, commands_package="bifocal.cli", **program("bifocal"))
@click.version_option(package_name=DISTRIBUTION, prog_name="bifocal")
def main() -> None:
    """Relief, coordinates and orthophotos of a wall from two photos of the same scale."""
