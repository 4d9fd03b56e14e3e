"""The answer to *can I trust it*: one record, which every verb shows of the same campaign and model alike."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

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
    figures : dict of float
        What the sentence rests on, relative to the RMS of the moment where that has a unit; NaN where it is not known.
    """

    name: str
    colour: Colour
    sentence: str
    figures: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        known = {name: value if math.isfinite(value) else None for name, value in self.figures.items()}
        return {"colour": self.colour, "sentence": self.sentence, **known}


@dataclass(frozen=True)
class Trust:
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

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        question: Mapping[str, Any] = {light.name: light.to_dict() for light in self.question}
        return {
            "answer": self.colour,
            **{light.name: light.to_dict() for light in self.lights},
            **({"question": question} if question else {}),
            "next": [{"do": do, "to": to} for do, to in self.next_steps],
        }
