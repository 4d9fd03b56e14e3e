"""What a diagnosis from the runs of a structure says beside the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sindyjoint.described import same
from sindyjoint.equation.model import JointModel
from sindyjoint.substructure.update import Update, UpdatedNumber


@dataclass(frozen=True)
class KindNumbers:
    """Numbers of a kind of joint: value and standard error by name."""

    terms: dict[str, tuple[float, float]]
    elements: dict[str, dict[str, tuple[float, float]]]

    @classmethod
    def of(cls, model: JointModel) -> KindNumbers:
        """Return those of a model."""
        return cls(
            {term.id: (term.coefficient, term.standard_error) for term in model.terms},
            {each.id: {n.name: (n.value, n.standard_error) for n in each.numbers} for each in model.elements},
        )


@dataclass(frozen=True, eq=False)
class InPlace:
    """What a diagnosis from the runs of a structure says of its joints and of itself.

    Parameters
    ----------
    lead : str
        The kind of joint whose model the diagnosis leads with.
    models : dict of str to JointModel
        By kind of joint, effects among them.
    update : Update or None
        Of the structure's uncertain numbers.
    """

    WRITTEN: ClassVar = same("lead", "kinds", "structure")
    lead: str
    models: dict[str, JointModel]
    update: Update | None

    @property
    def kinds(self) -> dict[str, KindNumbers]:
        """Numbers by kind of joint."""
        return {name: KindNumbers.of(model) for name, model in self.models.items()}

    @property
    def structure(self) -> tuple[UpdatedNumber, ...]:
        """The structure's uncertain numbers."""
        return () if self.update is None else self.update.numbers
