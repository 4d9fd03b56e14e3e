"""Filters on one channel: a delay, a high-pass (AC coupling) or a low-pass that must be undone for a law to fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.cycle import Complex, Cycles, synthesise
from sindyjoint.soundness.detectors.common_law import (
    Columns,
    CommonLaw,
    Scale,
    flexible_columns,
    plain_columns,
    rows_of,
    scale_of,
    solve,
)  # fmt: skip
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words

Filter = Callable[[Array, float], Complex]


def _delay(frequency: Array, time: float) -> Complex:
    return np.asarray(np.exp(2j * np.pi * frequency * time))


def _high_pass(frequency: Array, corner: float) -> Complex:
    """Inverse of a first-order high-pass; its corner in Hz."""
    safe = np.where(frequency > 0, frequency, 1.0)
    return np.where(frequency > 0, 1 + corner / (1j * safe), 1.0)


def _low_pass(frequency: Array, time: float) -> Complex:
    """Inverse of a first-order low-pass; its time constant in s."""
    return np.asarray(1 + 2j * np.pi * frequency * time)


@dataclass(frozen=True)
class Kind:
    """A filter that a channel may have passed: id, channel, its inverse, and the largest parameter tried."""

    id: str
    channel: str
    inverse: Filter
    largest: Callable[[float], float]
    both_ways: bool = False


DELAY = Kind("channel_delay", "moment", _delay, lambda f: 0.04 / f, True)
FILTERS = (
    Kind("ac_coupling", "moment", _high_pass, lambda f: 0.6 * f),
    Kind("ac_coupling", "angle", _high_pass, lambda f: 0.6 * f),
    Kind("low_pass", "moment", _low_pass, lambda f: 0.3 / (2 * np.pi * f)),
    Kind("low_pass", "angle", _low_pass, lambda f: 0.3 / (2 * np.pi * f)),
)
# Single columns that may pass for a delay of the plain law.
RIVALS: tuple[Callable[[Array, Array], Array], ...] = (
    lambda a, v: a**2 * v,
    lambda a, v: v * np.abs(v),
    lambda a, v: np.abs(a) * np.sign(v),
    lambda a, v: a**5,
    lambda a, v: np.exp(-np.abs(v) / 0.1) * np.sign(v),
)
# A relaxation of these times, in radians of the slowest run, lags the moment as well.
RELAXATIONS = (0.3, 1.0, 3.0)


@dataclass(frozen=True)
class Undone:
    """How well the runs have a law in common with a filter undone.

    Parameters
    ----------
    kind : Kind
    parameter : float
    before, left : float
        RMS that the law leaves without and with it, in parts of the moment's.
    """

    kind: Kind
    parameter: float
    before: float
    left: float


@dataclass(frozen=True, eq=False)
class Fit:
    """Runs and a law that they may have in common."""

    cycles: Cycles
    scale: Scale
    inertia: float | None
    columns: Columns = flexible_columns
    slowest: float = POLICY.moving_rate

    def misfit(self, kind: Kind | None = None, parameter: float = 0.0) -> float:
        """Return the RMS that the law leaves of all runs, a filter undone, in parts of the moment's."""
        signals = {"moment": self.cycles.moment, "angle": self.cycles.angle}
        if kind is not None:
            signals[kind.channel] = signals[kind.channel] * kind.inverse(self.cycles.lines, parameter)
        law = CommonLaw(self.scale, self.inertia, self.columns, self.slowest)
        rows = rows_of(self.cycles, law, signals["angle"], signals["moment"])
        return float(np.sqrt(solve(rows.products.sum(axis=0))[1] / len(self.cycles)))

    def best(self, kind: Kind) -> Undone:
        """Return the parameter of a filter under which the runs have most of a law in common."""
        largest = kind.largest(float(self.cycles.frequency.min()))
        before = self.misfit()
        low, high = (-largest if kind.both_ways else 0.0), largest
        for _ in range(4):
            grid = np.linspace(low, high, 7)
            values = [self.misfit(kind, p) for p in grid]
            at = int(np.argmin(values))
            low, high = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
        return Undone(kind, float(grid[at]), before, float(values[at]))


def find_filters(cycles: Cycles, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield the filter that one channel has passed and the other has not, where undoing it restores the law."""
    if len(cycles) < 2:
        return
    scale = scale_of(cycles)
    fit = Fit(cycles, scale, inertia)
    before = fit.misfit()
    delay = _find_delay(cycles, scale, inertia)
    tried = [fit.best(kind) for kind in FILTERS] if before > POLICY.filter_least else []
    best = min(tried, key=lambda u: u.left, default=None)
    if (
        best is not None
        and best.left < POLICY.filter_gain * best.before
        and best.left < POLICY.filter_left
        and (delay is None or best.left < POLICY.filter_over_delay * fit.misfit(DELAY, delay.parameter))
        and not _may_be_friction(fit, best)
    ):
        yield _filter_finding(best, cycles, words)
    elif delay is not None:
        yield _delay_finding(delay, words)


def _find_delay(cycles: Cycles, scale: Scale, inertia: float | None) -> Undone | None:
    """Return a delay between the channels that one column more of the plain law does not explain, or None.

    Rows close to the reversals show a delay best, as the friction steps there; but not where the joint sticks, whose
    standstill the series of the angle rounds.
    """
    rate = np.abs(cycles.motion()[1])
    slow = np.mean(rate < POLICY.nearest_rate * rate.max(axis=1, keepdims=True), axis=1)
    # A sinusoid is below a share s of its largest rate in 2 s/π of its time.
    never_sticks = slow.max() < 1.5 * POLICY.nearest_rate
    rates = (*POLICY.delay_rates, *((POLICY.nearest_rate,) if never_sticks else ()))
    fits = [Fit(cycles, scale, inertia, plain_columns, slowest) for slowest in rates]
    tried = [fit.best(DELAY) for fit in fits]
    # A law that is not the plain one finds another delay in other rows.
    fast = tried[0].parameter
    if not _agree(fast, tried[1].parameter):
        return None
    for fit, best in zip(fits, tried, strict=True):
        if not _is_delay(fit, best):
            continue
        if _agree(fast, best.parameter) and _is_one_time(fit, best):
            return best
        if _may_be_rounded(fast, best.parameter) and _is_one_time(fits[0], tried[0]):
            return tried[0]
    return None


def _agree(fast: float, slow: float) -> bool:
    """Return whether delays from rows of faster and of slower motion are one."""
    return abs(fast - slow) <= max(POLICY.delay_agreement * abs(fast), POLICY.least_delay)


def _may_be_rounded(fast: float, near: float) -> bool:
    """Return whether rows close to the reversals may show the delay of faster rows.

    Where friction bends the motion, the series of the angle rounds the bend, and turns too late: the moment then seems
    to lead by more than it does.
    """
    return abs(fast) > POLICY.least_delay and (near > 0 if fast > 0 else near < fast)


def _may_be_friction(fit: Fit, best: Undone) -> bool:
    """Return whether a low-pass on the moment may be friction that builds up with time, and lags by itself."""
    of_moment = best.kind.id == "low_pass" and best.kind.channel == "moment"
    return of_moment and not _is_one_time(fit, best, POLICY.filter_contrast)


def _is_one_time(fit: Fit, best: Undone, contrast: float = POLICY.delay_contrast) -> bool:
    """Return whether a time is the same at every frequency and level: the phase of a law or of noise is not.

    Its standard error is that of the jackknife over frequencies, or over levels where they scatter more.
    """
    size = np.argsort(np.abs(fit.cycles.angle[:, 1]))
    levels = np.array_split(size, min(POLICY.delay_levels, len(size)))
    frequencies = [np.flatnonzero(fit.cycles.frequency == f) for f in np.unique(fit.cycles.frequency)]
    error = max(_jackknife(fit, best.kind, groups) for groups in (levels, frequencies))
    return abs(best.parameter) > contrast * error


def _jackknife(fit: Fit, kind: Kind, groups: Sequence[NDArray[np.intp]]) -> float:
    """Return the standard error of a filter's time by its scatter, s, where each group of runs in turn is left out."""
    if len(groups) < 2:
        return 0.0
    everything = range(len(fit.cycles))
    others = [fit.cycles.take([i for i in everything if i not in set(group)]) for group in groups]
    times = [replace(fit, cycles=each).best(kind).parameter for each in others]
    return float(np.sqrt((len(times) - 1) * np.var(times)))


def _is_delay(fit: Fit, best: Undone) -> bool:
    """Return whether a delay wins much, leaves little, and no single further term wins as much."""
    gain = (best.before / max(best.left, 1e-12)) ** 2 - 1
    largest = 0.95 * DELAY.largest(float(fit.cycles.frequency.min()))
    if gain < POLICY.delay_gain or best.left > POLICY.delay_left:
        return False
    if not POLICY.least_delay < abs(best.parameter) < largest:
        return False
    rivals = [*RIVALS, *(_relaxation(fit.cycles, time) for time in RELAXATIONS)]
    return all(_gain_of(fit, rival, best.before) < POLICY.rival_gain * gain for rival in rivals)


def _relaxation(cycles: Cycles, time: float) -> Callable[[Array, Array], Array]:
    """Return the column of a Maxwell branch, q̇ = θ̇ − q/τ, whose phase does not grow with frequency for ever.

    The time constant is in parts of a radian of the slowest run: τ = time/(2π·f).
    """
    turn = 1j * cycles.lines * time / cycles.frequency.min()
    force = synthesise(cycles.angle * turn / (1 + turn))
    return lambda a, v: force / np.abs(force).max()


def _gain_of(fit: Fit, rival: Callable[[Array, Array], Array], before: float) -> float:
    def columns(a: Array, v: Array) -> list[Array]:
        return [*fit.columns(a, v), rival(a, v)]

    left = Fit(fit.cycles, fit.scale, fit.inertia, columns, fit.slowest).misfit()
    return (before / max(left, 1e-12)) ** 2 - 1


def _filter_finding(best: Undone, cycles: Cycles, words: Words) -> Finding:
    kind, channel = best.kind, words.of(best.kind.channel)
    gain = f"the law leaves {100 * best.before:.2g} % of the {words.moment} as it is and {100 * best.left:.2g} % so"
    if kind.id == "ac_coupling":
        lead = np.degrees(np.arctan(best.parameter / cycles.frequency.min()))
        return Finding(
            kind.id,
            None,
            kind.channel,
            "stops" if lead > POLICY.large_lead else "biases",
            f"the {channel} seems AC coupled with a corner of {best.parameter:.3g} Hz: it leads by {lead:.2g}° at "
            f"{cycles.frequency.min():g} Hz and less above ({gain})",
            "k1 and c1 depend on the frequency, k2 and the mean are lost, M_F fades over each half-cycle",
            "switch the coupling to DC and repeat the tests",
        )
    corner = 1 / (2 * np.pi * best.parameter)
    return Finding(
        kind.id,
        None,
        kind.channel,
        "biases",
        f"the {channel} seems to have passed a low-pass with a corner of {corner:.3g} Hz that the other channel has "
        f"not: it lags by {1e3 * best.parameter:.3g} ms ({gain})",
        f"shifts c1 by about {'-' if kind.channel == 'moment' else '+'}{best.parameter:.2g} s times k1, and rounds M_F",
        "set the same filter on both channels and repeat the tests",
    )


def _delay_finding(best: Undone, words: Words) -> Finding:
    lags = best.parameter > 0
    return Finding(
        "channel_delay",
        None,
        "moment",
        "biases",
        f"the {words.moment} {'lags' if lags else 'leads'} the {words.angle} by {1e3 * abs(best.parameter):.3g} ms",
        f"shifts c1 by about {-best.parameter:+.2g} s times k1, and makes damping of k2 and k3",
        "check the common trigger, run with --align, or declare [channels] skew",
    )
