"""What comes next at each stage of the page: one function of the survey's state."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from bifocal.collimation.live_orientation import LiveOrientation
from bifocal.collimation.product_graph import out_of_date, proposal_is_current
from bifocal.collimation.scale import is_unscaled
from bifocal.collimation.session import Session
from bifocal.collimation.wording import say, without_options
from photocore.remarks import level_of

#: Control points that orient a pair.
ENOUGH = 4
#: Sentences of `words.toml` that say the step of the orientation.
_SENTENCES = ("looking", "length", "accept", "changed")

#: What the button of the page does: go to a stage, or something at the stage that is shown.
Action = Literal[
    "photos", "orientation", "points", "products",
    "choose", "wait", "length", "control", "align", "accept", "make", "again", "download",
]  # fmt: skip
#: What a stage lacks.
Status = Literal[
    "done", "drop", "second", "photos", "looking", "changed", "length", "accept", "control",
    "align", "pair", "half", "none", "some", "make", "making", "stale",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class NextStep:
    """The step that comes next at a stage.

    Attributes
    ----------
    action : Action
    status : Status
        In the few words of the stage's tab.
    count : int
        The number that these words hold.
    ready : bool
        Whether the action can be taken now.
    done : bool
        Whether the stage has all that it needs.
    """

    action: Action
    status: Status = "done"
    count: int = 0
    ready: bool = True
    done: bool = False


def next_steps(session: Session) -> dict[str, NextStep]:
    """Return the next step of each stage."""
    return {
        "photos": _of_photos(session),
        "orientation": _of_orientation(session),
        "points": _of_points(session),
        "products": _of_products(session),
    }


def is_running(session: Session, *kinds: str) -> bool:
    """Whether a job of one of these kinds is running."""
    jobs = session.jobs.jobs.values()
    return any(job.kind in kinds and job.state == "running" for job in jobs)


def is_looking(session: Session) -> bool:
    """Whether the program looks for the wall by itself."""
    return any(job.quiet and job.state == "running" for job in session.jobs.jobs.values())


def _of_photos(session: Session) -> NextStep:
    photos = len(session.pictures.infos)
    if photos < 2:
        return NextStep("choose", "second" if photos else "drop")
    return NextStep("orientation", done=True)


def _of_orientation(session: Session) -> NextStep:
    if len(session.pictures.infos) < 2:
        return NextStep("photos", "photos")
    if session.accepted_pair is not None:
        return NextStep("points", done=True)
    control = session.state.control.values()
    if is_running(session, "align") and not (is_looking(session) and control):
        return NextStep("wait", "looking", ready=False)
    if session.proposal is not None:
        if not proposal_is_current(session):
            return NextStep("align", "changed")
        return (
            NextStep("length", "length") if is_unscaled(session) else NextStep("accept", "accept")
        )
    picked = sum(point.use and None not in point.picks for point in control)
    site = session.state.setup
    if picked < ENOUGH and not (site.get("d1") and site.get("d2")):
        return NextStep("control", "control", picked)
    return NextStep("align", "align")


def _of_points(session: Session) -> NextStep:
    state = session.state
    if session.accepted_pair is None and not (session.pictures.pair and state.points):
        return NextStep("orientation", "pair")
    half = sum(not point.is_complete for point in state.points.values())
    if half:
        return NextStep("products", "half", half)
    if not state.points:
        return NextStep("products", "none")
    return NextStep("products", "some", len(state.points), done=True)


def _of_products(session: Session) -> NextStep:
    if session.accepted_pair is None:
        return NextStep("orientation", "pair")
    if is_running(session, "deliver"):
        return NextStep("wait", "making", ready=False)
    names = [file["name"] for file in session.products.listed(session.files.workbook)]
    if not any(name.endswith(".pdf") for name in names):
        return NextStep("make", "make")
    return NextStep("again", "stale") if out_of_date(session) else NextStep("download", done=True)


def advice_of(
    session: Session, step: NextStep, live: LiveOrientation | None, remarks: Iterable[str]
) -> tuple[str, list[str]]:
    """Return the step of the orientation as a sentence, and all that would help.

    Parameters
    ----------
    session : Session
    step : NextStep
        Of the orientation.
    live : LiveOrientation, optional
        What the control points tell by themselves.
    remarks : iterable of str
        What is said of the pair, the worst first.

    Returns
    -------
    sentence : str
        Empty where there is none.
    advice : list of str
        What was found contradictory or unknown, the sentence, then hints.
    """
    language = session.spoken
    if step.status == "photos":
        sentence = say("ask", "photos", language)
        return sentence, [sentence]
    if step.done:
        doubt = [without_options(session.pick_doubt, language)] if session.pick_doubt else []
        sentence = "" if session.state.points else say("advice", "points", language)
        return sentence, doubt or [sentence] * bool(sentence)
    hints = list(live.advice) if live and (session.state.control or not session.proposal) else []
    if step.status in _SENTENCES:
        sentence = say("advice", step.status, language)
    else:
        sentence = hints.pop(0) if hints else say("advice", "enough", language)
    if step.status == "looking":
        return sentence, [sentence]
    worst = [text for text in remarks if level_of(text) != "hint"][:1] if session.proposal else []
    first = [without_options(text, language) for text in worst]
    return sentence, [*first, sentence, *hints]
