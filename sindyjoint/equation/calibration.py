"""What calibration does not know: an error of a channel's gain moves all coefficients of a law together.

A moment that is measured ε too large makes every coefficient c larger by ε·c; an angle that is measured ε too large
makes that of a term of degree p in angle and rate smaller by p·ε·c. No repetition of a test shows either.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_parts import INERTIA, ModelTerm
from sindyjoint.numeric import Array, partials


def with_gain_uncertainty(model: JointModel, gains: Mapping[str, float]) -> JointModel:
    """Return a model whose covariance and intervals hold the uncertainty of the channels' gains.

    Parameters
    ----------
    model : JointModel
        Whose ``fitted`` declares none yet.
    gains : mapping of str to float
        Relative standard uncertainty of ``"moment"``, ``"angle"`` and, where it is measured, ``"rate"``.
    """
    if not any(gains.values()) or not model.terms:
        return model
    fitted = replace(model.fitted, gains=dict(sorted(gains.items())))
    return replace(widened(model, _common(model, fitted.gains)), fitted=fitted)


def widened(model: JointModel, added: Array) -> JointModel:
    """Return a model whose covariance and intervals hold an error that all its rows share.

    Parameters
    ----------
    model : JointModel
    added : ndarray, shape (n_terms, n_terms)
        Covariance of the terms' coefficients by that error, SI.
    """
    size = len(model.terms)
    covariance = model.covariance_matrix
    covariance[:size, :size] += added
    terms = []
    for term, more in zip(model.terms, np.diag(added), strict=True):
        error = float(np.sqrt(term.standard_error**2 + more))
        # Noise keeps its quantile; calibration is as many degrees of freedom as its certificate.
        half = float(np.hypot((term.interval95[1] - term.interval95[0]) / 2, 1.96 * np.sqrt(more)))
        middle = sum(term.interval95) / 2
        terms.append(replace(term, standard_error=error, interval95=(middle - half, middle + half)))
    return replace(model, terms=tuple(terms), covariance=tuple(map(tuple, covariance.tolist())))


def gain_errors(model: JointModel) -> Array:
    """Return the part of each term's standard error that declared uncertainties of gains make, shape (n_terms,)."""
    return np.sqrt(np.diag(_common(model, model.fitted.gains))) if model.terms else np.zeros(0)


def gain_moves(model: JointModel, gains: Mapping[str, float]) -> dict[str, Array]:
    """Return by how much one standard uncertainty of each channel's gain moves the coefficients, shape (n_terms,)."""
    values = model.coefficients
    moves = {"moment": gains["moment"] * values} if "moment" in gains else {}
    if "angle" in gains or "rate" in gains:
        powers = np.array([_degrees(term, model) for term in model.terms])
        # Without a rate channel the rate is the angle's: both are wrong alike.
        angle = powers[:, 0] if "rate" in gains else powers.sum(axis=1)
        moves["angle"] = -gains.get("angle", 0.0) * angle * values
        moves["rate"] = -gains.get("rate", 0.0) * powers[:, 1] * values
    return {channel: move for channel, move in moves.items() if move.any()}


def _common(model: JointModel, gains: Mapping[str, float]) -> Array:
    """Return the covariance that errors of gains make, shape (n_terms, n_terms)."""
    size = model.coefficients.size
    return sum((np.outer(move, move) for move in gain_moves(model, gains).values()), np.zeros((size, size)))


def _degrees(term: ModelTerm, model: JointModel) -> tuple[float, float]:
    """Return the degree of a term in angle, and in rate (with the acceleration): ∂ln f/∂ln x over the tested range."""
    if term.id == INERTIA:
        return 0.0, 1.0

    fitted = model.fitted
    inputs = {each.name: max(each.tested or (each.reference,), key=abs) for each in model.inputs}
    function = compile_terms([term.expression], (*VARIABLES, *inputs))
    rng = np.random.default_rng(0)
    angle, rate = (rng.uniform(0.2, 1, 64) * (size or 1.0) for size in (fitted.angle, fitted.rate))

    def value(angle: Array, rate: Array) -> Array:
        return function(angle, rate, rate, *inputs.values())[:, 0]

    here = value(angle, rate)
    used = np.abs(here) > 1e-12 * np.abs(here).max(initial=1e-300)
    if not used.any():
        return 0.0, 0.0
    slopes = zip((angle, rate), partials(value, (angle, rate)), strict=True)
    first, second = (float(np.sum((x * s * here)[used]) / np.sum(here[used] ** 2)) for x, s in slopes)
    return first, second
