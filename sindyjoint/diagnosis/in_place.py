"""What a diagnosis from the runs of a structure says beside the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sindyjoint.equation.model import JointModel
from sindyjoint.substructure.update import Update


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

    lead: str
    models: dict[str, JointModel]
    update: Update | None

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "lead": self.lead,
            "kinds": {
                name: {
                    "terms": {term.id: [term.coefficient, term.standard_error] for term in model.terms},
                    "elements": {
                        each.id: {
                            number.name: [number.value, number.standard_error] for number in each.numbers
                        }
                        for each in model.elements
                    },
                }
                for name, model in self.models.items()
            },
            "structure": [] if self.update is None else self.update.to_list(),
        }
