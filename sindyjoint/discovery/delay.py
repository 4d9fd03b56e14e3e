"""Time delay between the moment and the angle channel.

A moment that lags by τ is the law at the state τ earlier. Seen as physics it adds τ·k1 to the damping (about an
eighth of c1 per millisecond for the paper's joint) and drags τ·2k2·θθ̇ and τ·3k3·θ²θ̇ along, so it is looked for
before any of these is believed. τ is a parameter of the regression, found by Gauss–Newton steps: the column
∂M/∂τ = −dM/dt joins the terms, its coefficient is the step, its standard error that of τ.

A law that lacks a term takes a delay for it: friction that grows with the angle looks like one. The delay therefore
competes with the candidate terms, and is that of the law they make.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sindyjoint.discovery import Evidence, RunEvidence, fit_columns
from sindyjoint.discovery.factors import Factor
from sindyjoint.equation.terms import Reference, ResolvedTerm, Term, term_columns
from sindyjoint.errors import InputError
from sindyjoint.inputs import Input, reference_values
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array, convolve, delayed, main_frequency, scaled_least_squares
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, aligned_run, campaign_states, moment_floor
from sindyjoint.text import quantities

# Gauss–Newton steps, and evenly spaced rows that suffice for them.
STEPS, ROWS = 4, 40_000


@dataclass(frozen=True)
class ChannelDelay:
    """Time by which the moment channel lags the angle channel.

    Parameters
    ----------
    time, standard_error : float
        s.
    residual_rms : float
        What the law leaves of the moment with the delay removed, N·m.
    disagreement : float
        By how many of their errors the delays of single runs differ, at least 1; the standard error is widened by it,
        and by what the law lacks.
    """

    time: float
    standard_error: float
    residual_rms: float = float("nan")
    disagreement: float = 1.0

    @property
    def at_limit(self) -> bool:
        """Whether the search ended at its longest delay: the value is then the limit's, not the data's."""
        return abs(self.time) >= DISCOVERY.longest_delay

    def unresolved(self, sample_rate: float) -> bool:
        """Whether, left in channels of a sampling rate (Hz), it leaves open which terms are there."""
        return self.significant and abs(self.time) * sample_rate > DISCOVERY.minor_share

    @property
    def significant(self) -> bool:
        """Whether it stands out of its error as a term must, and by more than 0.02 ms, the error of the method."""
        return abs(self.time) > max(DISCOVERY.term_significance * self.standard_error, DISCOVERY.least_delay)

    @property
    def stands_out(self) -> bool:
        """Whether it would, were the delays of all runs one: what a law lacks may look like that."""
        return replace(self, standard_error=self.standard_error / self.disagreement).significant


def shifted(states: ForceStates, time: float) -> ForceStates:
    """Return the states of ``time`` seconds earlier with the same moments: a lag of the moment undone.

    The motion is interpolated by cubic splines; it is band-limited, so nothing is lost.
    """
    if time == 0.0:
        return states
    samples = time * states.sample_rate
    moved = partial(delayed, samples=samples)
    moving = states.moving.copy()
    edge = int(np.ceil(abs(samples))) + 1
    moving[:edge] = False
    moving[-edge:] = False
    # The mask belongs to the motion: it travels with it, and half a sample is cut on both sides.
    index = np.arange(moving.size) - samples
    low = np.clip(np.floor(index).astype(int), 0, moving.size - 1)
    high = np.clip(np.ceil(index).astype(int), 0, moving.size - 1)
    replicate = states.replicate
    return replace(
        states,
        angle=moved(states.angle),
        rate=moved(states.rate),
        acceleration=moved(states.acceleration),
        moving=moving[low] & moving[high],
        replicate=None
        if replicate is None
        else (moved(replicate[0]), moved(replicate[1]), moved(replicate[2])),
    )


Columns = Callable[[Array, Array, Array, Mapping[str, Array]], Array]
"""Columns of a law, shape (n, p), at angle, rate, acceleration and inputs of n samples."""


def law_of_channels(inertia: float | None, inputs: Sequence[Input]) -> Columns:
    """Return the columns of the law that two channels of any joint have in common.

    Those of the paper's law, each linear in every input that was tested at more than one level, a constant, and an
    unknown inertia. They are no terms of a catalogue: every check of data needs them.
    """
    zero = dict(reference_values(inputs))
    moved = [each.name for each in inputs if each.levels > 1]

    def columns(angle: Array, rate: Array, acceleration: Array, values: Mapping[str, Array]) -> Array:
        law = np.column_stack([angle, angle**2, angle**2 * angle, rate, np.sign(rate)])
        others = [np.ones(angle.size), *([acceleration] if inertia is None else [])]
        return np.column_stack([law, *others, *((values[n] - zero[n])[:, None] * law for n in moved)])

    return columns


def columns_of(terms: Sequence[ResolvedTerm]) -> Columns:
    """Return the columns of a law that is made of terms."""
    return lambda angle, rate, acceleration, values: term_columns(
        terms, angle, rate, acceleration, inputs=values
    )


def find_delay(
    states: Sequence[ForceStates], inertia: float | None, inputs: Sequence[Input] = ()
) -> ChannelDelay | None:
    """Return the delay under the paper's law and a constant; None where the data do not carry that law.

    Of the law's coefficients each may depend linearly on every input. Candidates of the default catalogue that explain
    the moment better than the delay does join the law.
    """
    if not any(np.any(s.moment[s.moving]) for s in states) or np.ptp(states[0].moment) == 0:
        return None
    try:
        return competing_delay(states, law_of_channels(inertia, inputs), inertia)
    except (np.linalg.LinAlgError, InputError):
        # Dependent columns (one level of a pure sine): a delay cannot be distinguished from damping there.
        return None


def competing_delay(states: Sequence[ForceStates], law: Columns, inertia: float | None) -> ChannelDelay:
    """Return the delay under a law to which the candidate terms are added that explain the moment better than it."""
    delay, offered = estimate_delay(states, law, inertia), None
    while delay.significant and not delay.at_limit:
        offered = _candidates(states) if offered is None else offered
        better = _better_than(delay, states, law, inertia, offered)
        if better is None:
            break
        law = _joined(law, columns_of([offered.pop(better)]))
        delay = estimate_delay(states, law, inertia)
    return delay


def _candidates(states: Sequence[ForceStates]) -> list[ResolvedTerm]:
    """Return the terms of the default catalogue at the scales of some states, over the range of a parameter."""
    from sindyjoint.equation.catalogue import DEFAULT, load_catalogue

    angle, rate = (np.concatenate([getattr(s, name)[s.moving] for s in states]) for name in ("angle", "rate"))
    reference = Reference.of(angle, rate)
    return [each.resolve(reference) for term in load_catalogue(DEFAULT) for each in _over_range(term)]


def _over_range(term: Term) -> list[Term]:
    """Return a term at values of its parameter, or the term itself where it has none."""
    parameter = term.parameters[0] if len(term.parameters) == 1 else None
    if parameter is None or parameter.lower is None or parameter.upper is None:
        return [term]
    # Values that are tried over the range of a term's parameter.
    values = np.geomspace(parameter.lower, parameter.upper, 7)
    return [replace(term, parameters=(replace(parameter, value=value),)) for value in values]


def _joined(law: Columns, more: Columns) -> Columns:
    return lambda *motion: np.column_stack([law(*motion), more(*motion)])


def _better_than(
    delay: ChannelDelay,
    states: Sequence[ForceStates],
    law: Columns,
    inertia: float | None,
    offered: Sequence[ResolvedTerm],
) -> int | None:
    """Return the place of the candidate that wins most over a delay in its stead, or None where none does.

    A delay of z standard errors explains z² in units of what remains; a candidate as many more times as it makes the
    sum of squares fall by more.
    """
    stride = max(1, sum(s.n_samples for s in states) // ROWS)
    both = _joined(law, columns_of(offered))
    rows = [law_rows(s, both, inertia, stride) for s in states]
    triangle = Factor.of(np.vstack([r[0] for r in rows]), np.concatenate([r[1] for r in rows])).triangle
    size = np.linalg.norm(triangle, axis=0)
    known = triangle.shape[1] - 1 - len(offered)
    rest = triangle[known:, known:]  # what the law leaves of candidates and moment
    length = np.linalg.norm(rest[:, :-1], axis=0)
    free = length > 1e-6 * size[known:-1]  # others are columns of the law
    falls = np.where(free, (rest[:, -1] @ rest[:, :-1]) ** 2 / np.where(free, length, 1.0) ** 2, 0.0)
    count = sum(r[1].size for r in rows)
    own = float(rest[:, -1] @ rest[:, -1]) - count * delay.residual_rms**2
    if not own > 0:
        return None
    won = (falls / own - 1) * (delay.time / delay.standard_error) ** 2
    best = int(np.argmax(won))
    # A candidate that explains the moment better than the delay by this likelihood ratio belongs to the law.
    return best if won[best] > 2 * np.log(100.0) else None


def align_channels(campaign: Campaign) -> Campaign:
    """Return a campaign with a significant delay between its channels removed, which its notes then state.

    The delay is that of the runs for identification under the paper's law; see :func:`delay_to_remove`.
    """
    delay = delay_to_remove(campaign)
    return campaign if delay is None else without_delay(campaign, delay)


def delay_to_remove(campaign: Campaign) -> ChannelDelay | None:
    """Return the delay between the channels of a campaign where it is significant, and no end of the search."""
    delay = find_delay(campaign_states(campaign), campaign.joint.inertia, campaign.inputs)
    return None if delay is None or not delay.significant or delay.at_limit else delay


def without_delay(campaign: Campaign, delay: ChannelDelay) -> Campaign:
    """Return a campaign with a delay between its channels removed, which its notes then state."""
    runs = tuple(aligned_run(run, delay.time) for run in campaign.runs)
    return replace(
        campaign, runs=runs, notes=(*campaign.notes, said_of_removed(delay, campaign.joint.motion))
    )


def said_of_removed(delay: ChannelDelay, motion: str) -> str:
    """Return what to say of a delay that was removed, for rotation or translation."""
    words, side = quantities(motion), "lags" if delay.time > 0 else "leads"
    size = f"{1e3 * abs(delay.time):.3f} ± {1e3 * delay.standard_error:.3f} ms"
    return f"the {words.moment.lower()} {side} the {words.angle.lower()} by {size}; the channels were aligned"


def estimate_delay(
    states: Sequence[ForceStates],
    law: Columns,
    inertia: float | None,
) -> ChannelDelay:
    """Return the time by which the moment lags the angle, under a law.

    Parameters
    ----------
    states : sequence of ForceStates
    law : callable
        Its columns, whose coefficients are fitted anew at every step. Inertia among them where it is not declared.
    inertia : float or None
        kg·m².
    """
    states = [replace(s, replicate=None) for s in states]
    stride = max(1, sum(s.n_samples for s in states) // ROWS)
    time = 0.0
    for _ in range(STEPS):
        evidence = _linearise_law([shifted(s, time) for s in states], law, inertia, stride)
        fit = fit_columns(evidence, range(len(evidence.ids)))
        step, error, residual = float(fit.coefficients[-1]), float(fit.standard_errors[-1]), fit.residual_rms
        time = float(np.clip(time + step, -DISCOVERY.longest_delay, DISCOVERY.longest_delay))
        if abs(step) < 0.05 * error:
            break
    apart = _disagreement(evidence, residual)
    lacking = _error_by_lacking(states, evidence, time, law, inertia, residual)
    return ChannelDelay(time, float(np.hypot(apart * error, lacking)), residual, apart)


def _error_by_lacking(
    states: Sequence[ForceStates],
    evidence: Evidence,
    time: float,
    law: Columns,
    inertia: float | None,
    residual_rms: float,
) -> float:
    """Return the standard error of a delay by what the law lacks, s.

    What remains beyond the noise has some shape along the period of the motion, the same in every block and run: their
    scatter does not see it. A shape of RMS d with m independent values falls on a column of RMS u, of which the terms
    take no part, by d/√m in the root mean square, which is a delay of d/(u √m).
    """
    floor = moment_floor(states, inertia).moment
    beyond = float(np.sqrt(max(residual_rms**2 - np.nan_to_num(floor) ** 2, 0.0)))
    unique = abs(float(evidence.pooled.triangle[-2, -2])) / np.sqrt(evidence.pooled.rows)
    if not beyond > 0 or not unique > 0:
        return 0.0
    parts = [law_rows(shifted(s, time), law, inertia) for s in states]
    coefficients = _solve(parts)
    found = [
        _independent_values(target - columns @ coefficients, s)
        for (columns, target), s in zip(parts, states, strict=True)
        if target.size
    ]
    return beyond / (unique * float(np.sqrt(np.median(found))))


def law_coefficients(states: Sequence[ForceStates], law: Columns, inertia: float | None) -> Array:
    """Return the coefficients of a law by least squares over the moving samples of some states."""
    return _solve([law_rows(s, law, inertia) for s in states])


def _solve(rows: Sequence[tuple[Array, Array]]) -> Array:
    columns, target = map(np.concatenate, zip(*rows, strict=True))
    return scaled_least_squares(columns, target, 1e-12)


def _independent_values(residual: Array, states: ForceStates) -> float:
    """Return how many independent values a residual has in one period of the motion, at least one.

    Samples of a period over the integrated autocorrelation, 1 + 2 Σ r_k up to its first zero (Bartlett 1946).
    """
    frequency = states.frequency or main_frequency(states.angle, states.sample_rate)
    period = min(states.moving_fraction * states.sample_rate / max(frequency, 1e-300), residual.size)
    centred = residual - residual.mean()
    alike = convolve(centred, centred[::-1], mode="full")[centred.size - 1 :]
    if not alike[0] > 0:
        return 1.0
    alike = alike / alike[0]
    zero = np.flatnonzero(alike <= 0)
    together = 1 + 2 * float(np.sum(alike[1 : zero[0] if zero.size else alike.size]))
    return max(1.0, period / together)


def _disagreement(evidence: Evidence, residual_rms: float) -> float:
    """Return by how many of their errors the delays of the runs differ, at least 1 (Birge, Phys. Rev. 40, 1932).

    Channels have one delay. An effect that the law lacks, as hysteresis, is taken for another in every run: the fall of
    the sum of squares with a delay for each, by the number of further delays, over what remains of a degree of freedom.
    """
    rows, count = evidence.pooled.rows, len(evidence.runs)
    free = rows - count - len(evidence.ids)
    if count < 2 or free <= 0:
        return 1.0
    parts = []
    for run in evidence.runs:
        triangle = run.pooled.triangle
        delay = triangle[:, -2]
        others = np.delete(triangle, -2, axis=1)
        parts.append(others - np.outer(delay, delay @ others) / max(float(delay @ delay), 1e-300))
    stacked = np.vstack(parts)
    columns, target = stacked[:, :-1], stacked[:, -1]
    left = target - columns @ scaled_least_squares(columns, target, 1e-12)
    alone = max(float(left @ left), 1e-300)
    fall = max(rows * residual_rms**2 - alone, 0.0) / (count - 1)
    return max(1.0, float(np.sqrt(fall / (alone / free))))


def _linearise_law(
    states: Sequence[ForceStates], law: Columns, inertia: float | None, stride: int
) -> Evidence:
    """Return the evidence of [law | ∂M/∂τ], the derivative taken with the law's present coefficients."""
    rows = [law_rows(s, law, inertia, stride) for s in states]
    stacked = Factor.of(np.vstack([r[0] for r in rows]), np.concatenate([r[1] for r in rows]))
    coefficients = scaled_least_squares(stacked.triangle[:, :-1], stacked.triangle[:, -1], 1e-12)
    runs = []
    for state, (columns, moment) in zip(states, rows, strict=True):
        # dM/dt from the law half a sample on either side: exact for the law, no noise of the moment in it.
        half, block = 0.5 / state.sample_rate, state.block[state.moving][::stride]
        sides = [law_rows(state, law, inertia, stride, offset) for offset in (half, -half)]
        after, before = (target - beside @ coefficients for beside, target in sides)
        extended = np.column_stack([columns, (after - before) / (2 * half)])
        parts = tuple(Factor.of(extended[block == b], moment[block == b]) for b in np.unique(block))
        runs.append(RunEvidence(state.run, state.run, Factor.of(extended, moment), parts))
    return Evidence((*map(str, range(coefficients.size)), "delay"), tuple(runs))


def law_rows(
    states: ForceStates, law: Columns, inertia: float | None, stride: int = 1, offset: float = 0.0
) -> tuple[Array, Array]:
    """Return columns and target of the moving rows, their motion ``offset`` seconds later along its slopes.

    A lag of the moment shifts the inertia's moment as well. Where it is known it moves to the other side, but its
    slope stays: without the jerk even 0.02 kg·m² of the paper's joint shows 0.04 ms that are not there.
    """
    index = np.flatnonzero(states.moving)[::stride]
    inputs = {name: values[index] for name, values in states.inputs.items()}
    motion = (states.angle, states.rate, states.acceleration)
    slopes = (*motion[1:], np.gradient(states.acceleration, 1 / states.sample_rate))
    angle, rate, acceleration = (m[index] + offset * d[index] for m, d in zip(motion, slopes, strict=True))
    return law(angle, rate, acceleration, inputs), states.moment[index] - (inertia or 0.0) * acceleration
