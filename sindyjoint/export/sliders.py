"""Elements as springs in series with sliders, side by side: the form in which most programs hold hysteresis.

Where an element is no such pair, a set of pairs is fitted to its moment over the test cycles (Iwan 1966); what they
miss stands in the fidelity table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sindyjoint.equation.element import JointElement
from sindyjoint.export.base import Cycles, Represented
from sindyjoint.export.elements import Kind, Slider
from sindyjoint.numeric import Array

# Deflections at which fitted sliders may yield, as shares of the tested angle; the last one never does.
DEFLECTIONS = np.append(np.geomspace(0.01, 1.0, 19), 3.0)
# Pairs that carry less than this share of all are left out; a fit that misses more of an element than that is none.
LEAST_PAIR, WORST_FIT = 2e-3, 0.5


@dataclass(frozen=True, eq=False)
class Pairs:
    """An element as spring-slider pairs.

    Parameters
    ----------
    sliders : tuple of Slider
    moment : ndarray, shape (levels, phases)
        Of all of them over the cycles.
    exact : bool
        Whether the element is one of them, not only near to several.
    """

    sliders: tuple[Slider, ...]
    moment: Array
    exact: bool


def pairs_of(element: JointElement, kind: Kind | None, cycles: Cycles) -> Pairs | None:
    """Return an element as spring-slider pairs; None where they would miss too much of it."""
    if isinstance(kind, Slider) and kind.stiffness > 0:
        unit = _deflections(cycles, np.array([kind.deflection]))[0]
        return Pairs((kind,), kind.stiffness * unit, True)
    from scipy.optimize import nnls

    wanted = cycles.element(element)
    largest = float(np.abs(cycles.angle).max())
    yields = np.array([float(f"{largest * share:.4g}") for share in DEFLECTIONS])
    columns = _deflections(cycles, yields)
    stiffness, _ = nnls(columns.reshape(yields.size, -1).T, wanted.ravel())
    forces = stiffness * np.minimum(yields, yields[-2])
    kept = forces > LEAST_PAIR * forces.sum()
    if not kept.any():
        return None
    stiffness, _ = nnls(columns[kept].reshape(int(kept.sum()), -1).T, wanted.ravel())
    moment = np.tensordot(stiffness, columns[kept], 1)
    if not np.mean((moment - wanted) ** 2) < WORST_FIT**2 * np.mean(wanted**2):
        return None
    stiffness = np.array([float(f"{k:.6g}") for k in stiffness])
    moment = np.tensordot(stiffness, columns[kept], 1)
    sliders = tuple(Slider(float(k), float(y)) for k, y in zip(stiffness, yields[kept], strict=True) if k > 0)
    return Pairs(sliders, moment, False)


def represented(pairs: Pairs | None, how: str) -> Represented:
    """Return the row of an element that is spring-slider pairs, ``how`` being what the target calls one, or is none."""
    if pairs is None:
        return Represented("not carried: it is too far from springs in series with sliders", None)
    count = len(pairs.sliders)
    return Represented(how if pairs.exact else f"{count} x {how}, fitted over the tested range", pairs.moment)


def _deflections(cycles: Cycles, yields: Array) -> Array:
    """Deflections of springs in series with sliders over the cycles once they repeat, shape (n, levels, phases)."""
    found = np.empty((yields.size, *cycles.angle.shape))
    step = np.diff(cycles.angle, axis=1, prepend=cycles.angle[:, -1:])
    last = np.clip(cycles.angle[None, :, -1], -yields[:, None], yields[:, None])
    for _ in range(2):  # the first round forgets the start
        for i in range(cycles.angle.shape[1]):
            last = np.clip(last + step[:, i], -yields[:, None], yields[:, None])
            found[:, :, i] = last
    return found
