"""The answer to *can I trust it*: one record, which every verb shows of the same campaign and model alike."""

import re
import shlex
from collections.abc import Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from sindyjoint.described import Described, same

Colour = Literal["good", "fair", "poor"]
ORDER: tuple[Colour, ...] = ("good", "fair", "poor")
ANSWERS: dict[Colour, str] = {"good": "Yes", "fair": "With reservations", "poor": "Not yet"}


@dataclass(frozen=True)
class Light:
    """One of the reasons for trust or doubt.

    Parameters
    ----------
    name : str
        What is looked at: of a model ``"data"``, ``"explained"``, ``"predicts"``, ``"determined"``.
    colour : {"good", "fair", "poor"}
    sentence : str
    gap, floor : float, optional
        Residual of the moment and what of it does not repeat, relative to the RMS of the moment.
    interval : tuple of float, optional
        95 % interval of the gap.
    error : float, optional
        The same residual on what no fit has seen.
    widest : float, optional
        Half the 95 % interval over the coefficient, of the least sure one.
    inertia : float, optional
        That was identified, where no body has it, kg·m² (kg).
    """

    WRITTEN: ClassVar = {
        **same("colour", "sentence"),
        **{f"{name}?": name for name in ("gap", "floor", "interval", "error", "widest", "inertia")},
    }
    name: str
    colour: Colour
    sentence: str
    gap: float | None = None
    floor: float | None = None
    interval: tuple[float, float] | None = None
    error: float | None = None
    widest: float | None = None
    inertia: float | None = None


def doubt(name: str, found: str, fine: str) -> Light:
    """Return the reason for doubt that was found; that for trust where none was."""
    return Light(name, "fair", found) if found else Light(name, "good", fine)


@dataclass(frozen=True)
class NextStep:
    """A command, or an action on the bench, and what it is for."""

    do: str
    to: str


@dataclass(frozen=True)
class Places:
    """Where the data and the results of a command stand, as its user wrote them: next steps are written with these.

    Parameters
    ----------
    typed : tuple of str
        The command itself.
    subject, model, results : str
        Campaign or rig, empty for the built-in one; model that was given; folder of what was found, to be made by the
        command where there is none.
    kept : bool
        Whether that folder is written.
    """

    typed: tuple[str, ...] = ("sindyjoint",)
    subject: str = ""
    model: str = ""
    results: str = "results"
    kept: bool = False

    def fill(self, steps: Sequence[tuple[str, str]]) -> tuple[NextStep, ...]:
        """Return steps with these places in them, before them what makes the folder that they need."""
        first = []
        if not self.kept and any("RESULTS" in do for do, _ in steps):
            again = [word for word in self.typed if word != "--json"]
            first = [
                NextStep(shlex.join([*again, "--out", Path(self.results).parts[0]]), "keep what was found")
            ]
        return (*first, *(NextStep(self._filled(do), self._filled(to)) for do, to in steps))

    def _filled(self, text: str) -> str:
        # A model of the built-in virtual test is verified in the shipped rig.
        subject = self.subject or ("pulse-rig" if "verify" in text else "")
        known = {"CAMPAIGN": subject, "RIG": subject, "MODEL": self.model, "RESULTS": self.results}
        return re.sub(
            r" (CAMPAIGN|RIG|MODEL|RESULTS)\b",
            lambda found: f" {shlex.quote(known[found[1]])}" if known[found[1]] else "",
            text,
        )


PLACES: ContextVar[Places | None] = ContextVar("places", default=None)
"""Of the command that is running; none in Python, where next steps name the kinds of place."""


@dataclass(frozen=True)
class Trust(Described):
    """Whether to trust a result, why, and what to do next.

    Parameters
    ----------
    lights : tuple of Light
        Of the campaign and the model; the worst is the answer.
    next_steps : tuple of (str, str)
        A command, or an action on the bench, and what it is for; the most useful first.
    question : tuple of Light
        What the verb asked besides; it never changes the answer.
    """

    WRITTEN: ClassVar = {
        "answer": "colour",
        **{f"{name}?": name for name in ("data", "explained", "predicts", "determined")},
        "question?": "asked",
        "next": "advised",
    }
    lights: tuple[Light, ...]
    next_steps: tuple[tuple[str, str], ...] = ()
    question: tuple[Light, ...] = ()

    @property
    def colour(self) -> Colour:
        """The worst of the lights."""
        return max((light.colour for light in self.lights), key=ORDER.index)

    @property
    def answer(self) -> str:
        """Whether to trust it, in a word or two."""
        return ANSWERS[self.colour]

    @property
    def weak(self) -> set[str]:
        """Names of the lights, of the question too, that are not good."""
        return {light.name for light in (*self.lights, *self.question) if light.colour != "good"}

    def _light(self, name: str) -> Light | None:
        return next((light for light in self.lights if light.name == name), None)

    @property
    def data(self) -> Light | None:
        """Whether what was measured is sound."""
        return self._light("data")

    @property
    def explained(self) -> Light | None:
        """Whether the moment is explained to within what does not repeat."""
        return self._light("explained")

    @property
    def predicts(self) -> Light | None:
        """Whether that is so for what no fit has seen."""
        return self._light("predicts")

    @property
    def determined(self) -> Light | None:
        """Whether the runs excited what the coefficients stand for."""
        return self._light("determined")

    @property
    def asked(self) -> dict[str, Light]:
        """What the verb asked besides."""
        return {light.name: light for light in self.question}

    @property
    def advised(self) -> tuple[NextStep, ...]:
        """What to do next."""
        places = PLACES.get()
        return (
            tuple(NextStep(*step) for step in self.next_steps)
            if places is None
            else places.fill(self.next_steps)
        )
