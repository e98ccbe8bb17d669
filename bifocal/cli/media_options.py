"""Options of commands whose photos look through glass and water: stated once for all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from photocore.options import NOT_NEGATIVE, Names, Numbers, number

Command = TypeVar("Command", bound=Callable[..., Any])

#: What lies between the cameras and the wall.
_MEDIA = (
    click.option(
        "--indices", type=Numbers(), metavar="N,N,...",
        help="Refractive indices from the camera to the wall, where photos look through media.",
    ),
    click.option(
        "--thicknesses", type=Numbers(), metavar="T,...",
        help="Thicknesses of the media between the first and the last [m].",
    ),
    number(
        "--port", "M", "Camera centre to the first interface, where that moves with the camera "
        "[m].", type=NOT_NEGATIVE,
    ),
    number("--depth", "M", "Wall behind the glass or surface that stays with it [m]."),
)  # fmt: skip
#: Ports of their own, and what is not known of the media.
_OF_A_PAIR = (
    number("--port1", "M", "As --port, far photo only [m].", type=NOT_NEGATIVE),
    number("--port2", "M", "As --port, near photo only [m].", type=NOT_NEGATIVE),
    click.option(
        "--port-normal", metavar="axis|X,Y,R",
        help="A port that leans: square to the camera's optical axis, or its normal in the plane "
        "frame, towards the camera.  [default: parallel to the wall]",
    ),
    click.option("--port-normal1", metavar="axis|X,Y,R", help="The same, far photo only."),
    click.option("--port-normal2", metavar="axis|X,Y,R", help="The same, near photo only."),
    click.option(
        "--estimate", default="", type=Names(), metavar="LIST",
        help="Unknowns of the media, of index1,..., thickness1,..., port, port1, port2, lean1, "
        "lean2 (how a port leans), depth; known beforehand as --prior says, indices else to 0.005, "
        "lengths to a tenth, leans to 1 degree.  [default: none]",
    ),
    click.option(
        "--prior", multiple=True, metavar="NAME=SIGMA",
        help="Standard deviation of what is given of an unknown of the media [-, m, leans: "
        "degrees]; inf: not known at all; repeat it.",
    ),
)  # fmt: skip


def media(command: Command) -> Command:
    """Give a command the options of media: indices, thicknesses, a port or a depth."""
    for option in reversed(_MEDIA):
        command = option(command)
    return command


def media_of_pair(command: Command) -> Command:
    """Give a command `media`, and what a pair has besides: ports of its own, unknowns."""
    for option in reversed(_OF_A_PAIR):
        command = option(command)
    return media(command)
