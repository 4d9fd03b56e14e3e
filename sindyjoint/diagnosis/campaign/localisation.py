"""Where a campaign's gap lies, in angle, rate, direction, phase and runs, and the moments that pictures of it show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import modelled
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.parts import Place, Regions, most_informative
from sindyjoint.diagnosis.result import RunGap
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array
from sindyjoint.text import in_words_of


def locate_gap(problem: GapRegression, motion: str = "rotation") -> tuple[Place, ...]:
    """Return the regions that hold most of the gap beyond noise, compared with their share of the samples.

    Of bands that overlap the most informative one is named; words speak of the kind of motion, axes are called
    ``angle`` and ``rate`` for both.
    """
    sides = in_words_of(motion, "angles")
    excess = np.maximum(problem.residual**2 - 1.0, 0.0)
    if not excess.any():
        return ()
    angle, rate = (
        np.concatenate([getattr(run, name) for run in problem.runs]) / (largest or 1.0)
        for name, largest in (("angle", problem.reference.angle), ("rate", problem.reference.rate))
    )
    regions = Regions(excess, "samples", problem.policy)
    for axis, values, what in (
        ("angle", np.abs(angle), in_words_of(motion, "|angle|")),
        ("rate", np.abs(rate), in_words_of(motion, "|rate|")),
    ):
        for low, high in ((0.0, 0.1), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.01)):
            top = min(high, 1.0)
            words = f"{what} from {100 * low:.0f} % to {100 * top:.0f} % of the largest"
            regions.add(axis, (low, top), words, (values >= low) & (values < high))
    after = angle * rate < 0
    for axis, span, words, mask in (
        ("side", "positive angle", f"at positive {sides}", angle > 0),
        ("side", "negative angle", f"at negative {sides}", angle < 0),
        ("direction", "forward", "in forward motion", rate > 0),
        ("direction", "backward", "in backward motion", rate < 0),
        ("phase", "after reversal", "after the reversals, on the way back to zero", after),
        ("phase", "before reversal", "before the reversals, on the way out", ~after),
    ):
        regions.add(axis, span, words, mask)
    for axis, label, rows in _labelled(problem.runs):
        regions.add(axis, label, f"{axis} {label}", rows)
    return most_informative(regions.found, problem.policy)


def _labelled(runs: Sequence[GapRun]) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    """Yield each frequency, level and run by name, and which rows are of it."""
    for axis, labels in (
        ("frequency", [f"{r.motion.frequency:.3g} Hz" if r.motion.frequency else "" for r in runs]),
        ("level", [r.level or "" for r in runs]),
        ("run", [r.name for r in runs]),
    ):
        rows = np.concatenate(
            [np.full(r.target.size, label, dtype=object) for r, label in zip(runs, labels, strict=True)]
        )
        for label in dict.fromkeys(labels):
            if label:
                yield axis, label, rows == label


MOST_RUNS = 12
# Of a long run one stretch, of which curves are drawn, and evenly some of the other rows, for maps.
CURVE_ROWS = 400
CURVE_PERIODS = 2
MOST_ROWS = 1500


def run_gaps(
    rows: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect] = (), zero: float = 0.0
) -> tuple[RunGap, ...]:
    """Return up to twelve runs, spread over the campaign, beside a model with effects; long ones thinned.

    Rows are moments of the joint, channels put right: a time shift among the effects is in them already. Angles are as
    measured: ``zero``, from which those of the rows are counted, is added.
    """
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_RUNS)).round().astype(int))
    whole = [rows[i].whole() for i in chosen]
    return tuple(_beside(run, modelled(run, model, effects), zero) for run in whole)


def _beside(run: GapRun, model: Array, zero: float) -> RunGap:
    keep = run.motion.keep
    time = np.asarray(run.motion.step * keep if run.folded else run.motion.time[keep], dtype=np.float64)
    curve = _stretch(run, time)
    part = np.concatenate([curve, _others(time.size, curve)])
    return RunGap(
        run=run.name,
        level=run.level,
        frequency=run.motion.frequency,
        repeats=run.folded,
        time=time[part],
        angle=run.angle[part] + zero,
        rate=run.rate[part],
        measured=run.target[part],
        model=model[part],
        noise=_noise(run),
        curve=curve.size,
    )


def _stretch(run: GapRun, time: Array) -> NDArray[np.intp]:
    """Return the rows of a stretch: the mean period; some periods of a sine; of other runs where most is going on."""
    every = np.arange(time.size)
    if run.folded or time.size < 2:
        return every
    span, periodic = time[-1] - time[0], run.motion.frequency > 0
    length = (
        CURVE_PERIODS / run.motion.frequency if periodic else CURVE_ROWS * float(np.median(np.diff(time)))
    )
    # A sine has settled in the middle half of its run; the stretch that holds most rows is shown.
    low, high = (0.25 * span, 0.75 * span) if periodic else (0.0, max(span - length, 0.0))
    starts = time[0] + np.linspace(low, high, 41)
    first = np.searchsorted(time, starts)
    last = np.searchsorted(time, starts + length, side="right")
    weight = np.ones(time.size) if periodic else run.target**2
    held = np.append(0.0, np.cumsum(weight))
    best = int(np.argmax(held[last] - held[first]))
    return every[first[best] : last[best] : max(1, -(-int(last[best] - first[best]) // CURVE_ROWS))]


def _others(size: int, curve: NDArray[np.intp]) -> NDArray[np.intp]:
    left = np.setdiff1d(np.arange(size), curve)
    return left[:: max(1, -(-left.size // (MOST_ROWS - CURVE_ROWS)))]


def _noise(run: GapRun) -> float:
    """Return the RMS of a row's noise: of a mean period from the covariance of its rows, (F'F)⁻¹."""
    if not run.folded:
        return float(np.sqrt(run.variance))
    lower = np.linalg.inv(run.factor)
    return float(np.sqrt(np.mean(np.sum(lower**2, axis=1))))
