"""Whether a motion stays within what a model was fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.equation.model import JointModel
from sindyjoint.response.policy import POLICY
from sindyjoint.text import percent, quantities


def range_warnings(
    model: JointModel, angle: ArrayLike, rate: ArrayLike, where: str, timed: bool = True
) -> tuple[str, ...]:
    """Return what to say of a motion that goes beyond the angle or rate that the model was tested to; often nothing.

    Parameters
    ----------
    model : JointModel
    angle, rate : array_like, shape (n,)
        rad, rad/s (m, m/s).
    where : str
        Of which motion this is.
    timed : bool
        Whether it is a motion in time.
    """
    words, fitted = quantities(model.joint.motion), model.fitted
    unit = "rad" if model.joint.motion == "rotation" else "m"
    found = []
    if fitted.quasi_static or not timed:
        rate = np.zeros(1)
    untimed = f"{where}: the model was fitted to samples without time: what depends on the rate is not in it"
    lines = (untimed,) if fitted.quasi_static and timed else ()
    for name, signal, tested, si in (
        (words.angle.lower(), angle, fitted.angle, unit),
        (words.rate.lower(), rate, fitted.rate, f"{unit}/s"),
    ):
        size = np.abs(np.asarray(signal, dtype=np.float64))
        share = float(np.mean(size > (1 + POLICY.range_slack) * tested)) if tested > 0 else 0.0
        if share > POLICY.range_time:
            found.append(
                f"{name} up to {size.max():.3g} {si} where {tested:.3g} was tested ({percent(share)} of the time)"
            )
    return (*lines, f"{where}: beyond the tested range: {'; '.join(found)}") if found else lines
