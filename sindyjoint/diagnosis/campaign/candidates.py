"""Nonlinear parameters of an effect, refitted by variable projection near where they were."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.effects.fitted import FittedEffect

# Nonlinear parameters are refined until their gain rises by less than this, or this share of it.
LEAST_RISE, SHARE_OF_RISE = 0.02, 1e-5
MOST_TRIALS = 80  # of nonlinear parameters, per parameter; a ridge is followed slowly


def refine_effect(problem: GapRegression, fitted: FittedEffect) -> FittedEffect:
    """Return an effect with its nonlinear parameters refitted near where they were."""
    if not fitted.values.size:
        return fitted
    from scipy.optimize import minimize

    within = fitted.variant.bounds(problem.reference) if fitted.within is None else fitted.within
    bounds = np.log(within).T
    start = np.clip(np.log(fitted.values), *bounds)
    found = minimize(
        lambda p: -problem.gain(fitted.variant, np.exp(np.clip(p, *bounds)))[0],
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack(
                [start, start + np.diag(np.where(start + 0.1 < bounds[1], 0.1, -0.1))]
            ),
            "xatol": 1e-3,
            "fatol": max(LEAST_RISE, SHARE_OF_RISE * fitted.gain),
            "maxfev": MOST_TRIALS * start.size,
        },
    )
    values = np.exp(np.clip(found.x, *bounds))
    gain, coefficients = problem.gain(fitted.variant, values)
    return replace(fitted, values=values, gain=gain, coefficients=coefficients)
