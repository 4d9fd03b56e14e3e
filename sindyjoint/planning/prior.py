"""What is known before a plan is made: the joint's range, and the information of the runs that were made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.discovery.evidence import Evidence, block_scores
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.numeric import Array
from sindyjoint.planning.information import Information, Sensors, stacked
from sindyjoint.planning.joints import JointRange, like_model
from sindyjoint.states import ForceStates
from sindyjoint.text import spelled


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before the plan.

    Parameters
    ----------
    joint : JointRange
    information : Information, optional
        Of the runs that were made, with axis (runs,).
    runs : tuple of (float, float)
        Frequency and swing of the angle of each, Hz and rad.
    seconds : float
        Duration of these runs.
    model : JointModel, optional
        That was found in them.
    ids : tuple of str
        Terms that the joint was said to have; default: all of the range's.
    notes : tuple of str
    """

    joint: JointRange
    information: Information | None = None
    runs: tuple[tuple[float, float], ...] = ()
    seconds: float = 0.0
    model: JointModel | None = None
    ids: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", self.ids or self.joint.model.ids)

    def expanded(self, joints: int) -> Information | None:
        """Return the information of the made runs for as many joints."""
        if self.information is None:
            return None
        held = self.information
        names = ("bread", "meat", "pull", "blocks")
        return Information(
            *(
                np.repeat(np.asarray(getattr(held, name))[:, None], joints, axis=1).astype(float)
                for name in names
            )
        )

    def half_widths(self) -> Array:
        """Return the half-widths of the 95 % intervals that the runs made so far have given; infinite without any."""
        terms = self.joint.model.terms
        if self.model is None:
            return np.full(len(terms), np.inf)
        return np.array([(term.interval95[1] - term.interval95[0]) / 2 for term in self.model.terms])


def prior_of_runs(
    model: JointModel,
    evidence: Evidence,
    states: Sequence[ForceStates],
    seconds: float,
    before: JointRange | None = None,
) -> Prior:
    """Return the information of runs on the terms of a model that was found in them.

    Parameters
    ----------
    model : JointModel
    evidence : Evidence
        Of the runs, for these terms among others.
    states : sequence of ForceStates
    seconds : float
        Duration of the runs.
    before : JointRange, optional
        What was known of its coefficients before the runs; both hold.

    Raises
    ------
    InputError
        For a model of which no plan is made, and coefficients that were not fitted.
    """
    joint = like_model(model)
    lacking = [spelled(name) for name in model.ids if name not in evidence.ids]
    if lacking:
        raise InputError(f"{', '.join(lacking)}: fixed in the fit of the campaign; plan with ranges")
    columns = [evidence.ids.index(name) for name in model.ids]
    parts, size = [], len(columns)
    for run in evidence.take(columns).runs:
        scores, _ = block_scores(Evidence(model.ids, (run,)), range(size), model.coefficients)
        triangle = run.pooled.triangle[:, :-1]
        parts.append(
            Information(
                triangle.T @ triangle, scores.T @ scores, np.zeros(size), np.array(float(len(run.blocks)))
            )
        )
    notes: tuple[str, ...] = ()
    if before is not None:
        joint, notes = _both(joint, before)
    runs = tuple((state.frequency or 0.0, float(np.ptp(state.angle)) / 2) for state in states)
    ids = () if before is None else before.model.ids
    return Prior(joint, stacked(parts), runs, seconds, model, ids, notes)


def _both(found: JointRange, before: JointRange) -> tuple[JointRange, tuple[str, ...]]:
    """Return the ranges that both allow; where none does, that of the runs, with a note."""
    low, high = found.low.copy(), found.high.copy()
    notes = []
    for at, name in enumerate(found.model.ids):
        if name not in before.model:
            continue
        there = before.model.ids.index(name)
        least, most = max(low[at], before.low[there]), min(high[at], before.high[there])
        if least <= most:
            low[at], high[at] = least, most
        else:
            notes.append(
                f"the runs put {spelled(name)} outside of the range that was given, "
                f"{before.low[there]:.4g} to {before.high[there]:.4g}: the runs are believed"
            )
    # A discovery knows no elements: those that the joint was said to have stay.
    model = replace(found.model, elements=before.model.elements, covariance=())
    return JointRange(model, low, high), tuple(notes)


def measured_sensors(states: Sequence[ForceStates]) -> Sensors:
    """Return rate and noise of the sensors as runs have shown them: each channel's noise is the mean over the runs."""
    noise = [[getattr(state.noise, name) for state in states] for name in ("moment", "angle")]
    moment, angle = (float(np.sqrt(np.mean(np.square(each)))) for each in noise)
    rate = float(np.median([state.sample_rate for state in states]))
    # What could not be told apart from nothing is no noise of zero.
    return Sensors(rate, moment=moment if moment > 0 else None, angle=angle if angle > 0 else None)
