"""What must hold of a model that was read from a file beyond its record, before anything is computed with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.errors import InputError

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel

# A term of a law that was measured stays near the measured moment; collinear terms may cancel, not to this extent.
LARGEST_SHARE = 1e6


def check_model(model: JointModel) -> None:
    """Refuse a model of which a term is beyond all measure within the range that it was fitted on.

    Raises
    ------
    InputError
        Naming the term.
    """
    from sindyjoint.equation.formula import VARIABLES, compile_terms, variable_symbols

    fitted = model.fitted
    if not (fitted.moment_rms > 0 and fitted.angle > 0 and fitted.rate > 0):
        return
    acceleration = variable_symbols()[2]
    terms = [term for term in model.terms if acceleration not in term.expression.free_symbols]
    if not terms:
        return
    angle, rate = (a.ravel() for a in np.meshgrid(fitted.angle * np.array([-1, -0.5, 0.5, 1]),
                                                  fitted.rate * np.array([-1, -0.5, 0.5, 1])))  # fmt: skip
    with np.errstate(all="ignore"):
        far = {each.name: max(each.tested or (each.reference,), key=abs) for each in model.inputs}
        moments = compile_terms([term.expression for term in terms], (*VARIABLES, *far))(
            angle, rate, np.nan, *far.values()
        )
        moments = np.abs(moments * [term.coefficient for term in terms]).max(axis=0)
    for term, moment in zip(terms, moments, strict=True):
        if not moment <= LARGEST_SHARE * fitted.moment_rms:
            raise InputError(
                f"term {term.id!r}: its coefficient {term.coefficient:g} makes {moment:.3g} within the tested range, "
                f"where {fitted.moment_rms:.3g} was measured; the file was changed or damaged"
            )
