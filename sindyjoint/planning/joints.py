"""The joint that is to be tested, as far as it is known: a law with a range for each of its coefficients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.equation.model import INERTIA, Fitted, JointModel, model_terms
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.mechanics.laws import PaperLaw
from sindyjoint.numeric import Array
from sindyjoint.paper import PARAMETERS
from sindyjoint.planning.policy import POLICY
from sindyjoint.record import Joint
from sindyjoint.response.model_law import with_coefficients

MOST_CORNERS = 64
LEAST_INERTIA = 0.1  # of the identified one: without any a joint under a moment does not move as a body


@dataclass(frozen=True, eq=False)
class JointRange:
    """A joint whose coefficients lie in ranges.

    Parameters
    ----------
    model : JointModel
        Its terms and inertia; the coefficients are those in the middle. Elements with a memory, where it has some, are
        the same in every joint of the range.
    low, high : ndarray, shape (p,)
        Ends of the range of each coefficient, in the order of the terms, SI.
    """

    model: JointModel
    low: Array
    high: Array

    def draws(self, count: int, random_state: int | np.random.Generator = 0) -> list[JointModel]:
        """Return joints of the range, spread evenly over every coefficient (a Latin hypercube)."""
        rng = np.random.default_rng(random_state)
        strata = np.array([rng.permutation(count) for _ in self.low]).T
        share = (strata + rng.random(strata.shape)) / count
        return [with_coefficients(self.model, row) for row in self.low + share * (self.high - self.low)]

    def corners(self) -> list[JointModel]:
        """Return the joints at the ends of all ranges; of many coefficients some of the combinations."""
        wide = np.flatnonzero(self.high > self.low)
        if 2**wide.size <= MOST_CORNERS:
            choices = np.array(list(product((0.0, 1.0), repeat=int(wide.size)))).reshape(-1, wide.size)
        else:
            choices = np.random.default_rng(0).integers(0, 2, (MOST_CORNERS, wide.size)).astype(float)
        corners = np.tile(self.low, (len(choices), 1))
        corners[:, wide] += choices * (self.high - self.low)[wide]
        return [with_coefficients(self.model, row) for row in np.unique(corners, axis=0)]

    def narrowed(self, ranges: Mapping[str, tuple[float, float]]) -> JointRange:
        """Return the same joint with some of its coefficients in other ranges.

        Raises
        ------
        UnknownNameError
            For a term that the joint does not have.
        InputError
            For a range whose ends are not finite and ascending.
        """
        low, high = self.low.copy(), self.high.copy()
        for name, (least, most) in ranges.items():
            if name not in self.model:
                known = ", ".join(self.model.ids)
                raise UnknownNameError(f"range of {name!r}: the joint has no such term; it has {known}")
            if not (np.isfinite(least) and np.isfinite(most) and least <= most):
                raise InputError(
                    f"range of {name}: {least:g} to {most:g}; expected two ascending finite numbers"
                )
            at = self.model.ids.index(name)
            low[at], high[at] = least, most
        return JointRange(with_coefficients(self.model, (low + high) / 2), low, high)


def like_law(law: PaperLaw) -> JointRange:
    """Return the range of joints like one of the paper's: every coefficient within a share of its own."""
    catalogue = load_catalogue("paper").select(list(PARAMETERS))
    values = np.array([getattr(law, symbol) for symbol in PARAMETERS.values()])
    resolved = list(catalogue.resolve())
    order = [list(PARAMETERS).index(term.id) for term in resolved]
    zero = np.zeros(len(order))
    terms = model_terms(resolved, values[order], np.diag(zero), zero + np.nan, 1, "rotation")
    fitted = Fitted(1.0, 0.0, 0.0, 1.0, 0, 0, min(law.softening_angle, 1.0), 1.0)
    model = JointModel(Joint(law.name, inertia=law.inertia), terms, (), fitted)
    half = POLICY.spread * np.abs(model.coefficients)
    return JointRange(model, model.coefficients - half, model.coefficients + half)


def like_model(model: JointModel) -> JointRange:
    """Return the range of a model: every coefficient within some of its standard errors.

    Raises
    ------
    InputError
        For a model without terms.
    """
    if not model.terms:
        raise InputError("the model has no terms; a plan is made for terms of angle and rate")
    half = POLICY.model_errors * model.standard_errors
    low, high = model.coefficients - half, model.coefficients + half
    for index, term in enumerate(model.terms):
        if (term.family == "friction" or term.id == INERTIA) and term.coefficient > 0:
            low[index] = max(low[index], LEAST_INERTIA * term.coefficient if term.id == INERTIA else 0.0)
    return JointRange(replace(model, covariance=()), low, high)
