"""JSON: the model as discover writes it, with its fidelity table; every command reads it back."""

from __future__ import annotations

import json
from dataclasses import asdict

from sindyjoint.equation.model import JointModel
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table


def export(model: JointModel) -> Export:
    """Write ``model.json``."""
    cycles = Cycles.of(model)
    represented = {
        term.id: Represented("formula, coefficient, covariance", cycles.term(term)) for term in model.terms
    }
    represented |= {
        e.id: Represented("formulas, numbers, covariance", cycles.element(e)) for e in model.elements
    }
    rows = fidelity_table(model, cycles, represented)
    record = {**model.to_dict(), "fidelity": [asdict(row) for row in rows]}
    return Export("json", {"model.json": json.dumps(record, indent=1) + "\n"}, rows)
