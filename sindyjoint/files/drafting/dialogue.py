"""Questions that files alone cannot answer, and the answers that a person gave."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field

from sindyjoint.errors import UnknownNameError

KEYS = ("name", "motion", "inertia", "mass", "time", "time.unit", "rate") + tuple(
    f"{channel}{part}"
    for channel in (
        "moment",
        "angle",
        "rate_of_angle",
        "force",
        "displacement",
        "rate_of_displacement",
        "acceleration",
    )
    for part in ("", ".unit", ".gain")
)


@dataclass(frozen=True)
class Question:
    """What the files do not say.

    Parameters
    ----------
    key : str
        By which it is answered: ``"angle.unit"``, ``"rate"`` ...
    text : str
        The question.
    guess : str or None
        The likeliest answer; None where any would be invented.
    complaint : str
        What was wrong with the last answer, where it is asked again.
    """

    key: str
    text: str
    guess: str | None
    complaint: str = ""


@dataclass
class Dialogue:
    """Collects questions while a manifest is drafted, and gives the answers that are there already.

    Parameters
    ----------
    answers : mapping of str to str
    """

    answers: Mapping[str, str]
    questions: dict[str, Question] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for key in self.answers:
            if key not in KEYS:
                near = difflib.get_close_matches(key, KEYS, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(KEYS)}"
                raise UnknownNameError(f"{key!r} is nothing that can be set; {hint}")

    def ask(self, key: str, text: str, guess: str | None) -> str | None:
        """Return the answer to a question, or its guess, which is then a doubt."""
        if key in self.answers:
            return self.answers[key]
        self.questions.setdefault(key, Question(key, text, guess))
        return guess

    def why(self, key: str, otherwise: str) -> str:
        """Return where a value comes from: it was set, guessed, or what is said otherwise."""
        return "set" if key in self.answers else "guessed" if key in self.questions else otherwise

    def mark(self, *keys: str) -> str:
        """Return the comment that marks a line of the manifest with a guess in it."""
        return "  # guessed" if any(key in self.questions for key in keys) else ""
