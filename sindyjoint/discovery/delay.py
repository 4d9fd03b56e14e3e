"""Time delay between the moment and the angle channel.

A moment that lags by τ is the law at the state τ earlier. Seen as physics it adds τ·k1 to the damping (about an
eighth of c1 per millisecond for the paper's joint) and drags τ·2k2·θθ̇ and τ·3k3·θ²θ̇ along. So −dM/dt is one more
column beside the terms, found by Gauss–Newton steps: its coefficient is the step, its standard error that of τ. What
the law lacks is a covariance of the rows beside their noise (:mod:`sindyjoint.evidence`), and a delay is announced
where runs are predicted better with it than without, by the limits that every candidate of a diagnosis has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.policy import POLICY
from sindyjoint.equation.catalogue import Catalogue, Reference, load_catalogue, term_columns
from sindyjoint.equation.dependences import linear_dependences
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import InputError
from sindyjoint.evidence.rows import Rotated
from sindyjoint.evidence.score import Evidence
from sindyjoint.evidence.search import Candidate, Chosen, Search
from sindyjoint.inputs import Input, lagged, reference_values
from sindyjoint.numeric import Array, delayed, main_frequency, scaled_least_squares
from sindyjoint.record import Campaign
from sindyjoint.states import campaign_states
from sindyjoint.states.campaigns import aligned_run
from sindyjoint.states.record import ForceStates
from sindyjoint.text import quantities

# Gauss–Newton steps, and evenly spaced rows that suffice for them.
STEPS, ROWS = 3, 40_000
# Rows of a run are means over cells of this part of a cycle; a discrepancy keeps its sign over several.
CELL, CELLS = 0.02, 600
# Groups of rows that are predicted from the others: runs, and segments of them where runs are fewer.
GROUPS = 8
# Branches that a delay may be taken for: relaxation times, in cycles over 2π, and yield angles, in the largest angle.
RELAXED, YIELDING = (0.3, 1.0, 3.0, 10.0), (0.03, 0.1, 0.3)
# Noise of the moment, relative to its RMS, that rows are never better than.
LEAST_NOISE = 1e-6


@dataclass(frozen=True)
class ChannelDelay:
    """Time by which the moment channel lags the angle channel.

    Parameters
    ----------
    time, standard_error : float
        s. The error holds what the law lacks.
    residual_rms : float
        What the law leaves of the moment with the delay removed, N·m.
    predicts : bool
        Whether runs are predicted from others better with it than without, by more than chance.
    """

    time: float
    standard_error: float
    residual_rms: float = float("nan")
    predicts: bool = True

    @property
    def at_limit(self) -> bool:
        """Whether the search ended at its longest delay: the value is then the limit's, not the data's."""
        return abs(self.time) >= POLICY.longest_delay

    def unresolved(self, sample_rate: float) -> bool:
        """Whether, left in channels of a sampling rate (Hz), it leaves open which terms are there."""
        return self.significant and abs(self.time) * sample_rate > POLICY.unresolved_delay

    @property
    def significant(self) -> bool:
        """Whether it stands out, and other runs are predicted better with it."""
        return self.stands_out and self.predicts

    @property
    def stands_out(self) -> bool:
        """Whether it stands three standard errors out, and by more than 0.02 ms, the error of the method."""
        return abs(self.time) > max(POLICY.delay_significance * self.standard_error, POLICY.least_delay)


def shifted(states: ForceStates, time: float) -> ForceStates:
    """Return the states of ``time`` seconds earlier with the same moments: a lag of the moment undone.

    The motion is interpolated by cubic splines; it is band-limited, so nothing is lost.
    """
    if time == 0.0:
        return states
    samples = time * states.sample_rate

    def moved(signal: Array) -> Array:
        return delayed(signal, samples)

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


def law_of_channels(inertia: float | None) -> Catalogue:
    """Return the law that two channels of any joint have in common: the paper's, a constant, an unknown inertia."""
    law = load_catalogue("paper").union(load_catalogue("extended").select(["constant_moment"]))
    return law.union(load_catalogue("inertia")) if inertia is None else law


def find_delay(
    states: Sequence[ForceStates], inertia: float | None, inputs: Sequence[Input] = ()
) -> ChannelDelay | None:
    """Return the delay under the paper's law and a constant; None where the data do not carry that law.

    Of the law's coefficients each may depend linearly on every input.
    """
    if not any(np.any(s.moment[s.moving]) for s in states) or np.ptp(states[0].moment) == 0:
        return None
    law = linear_dependences(law_of_channels(inertia), inputs)
    reference = replace(reference_of(states), inputs=reference_values(inputs))
    try:
        return estimate_delay(states, law.resolve(reference), inertia)
    except (np.linalg.LinAlgError, InputError):
        # Dependent columns (one level of a pure sine): a delay cannot be distinguished from damping there.
        return None


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
    words = quantities(campaign.joint.motion)
    moment, angle = words.moment.lower(), words.angle.lower()
    note = (
        f"the {moment} {'lags' if delay.time > 0 else 'leads'} the {angle} by {1e3 * abs(delay.time):.3f} ± "
        f"{1e3 * delay.standard_error:.3f} ms; the channels were aligned"
    )
    return replace(campaign, runs=runs, notes=(*campaign.notes, note))


def estimate_delay(
    states: Sequence[ForceStates],
    terms: Sequence[ResolvedTerm],
    inertia: float | None,
) -> ChannelDelay:
    """Return the time by which the moment lags the angle, under a law made of ``terms``.

    Parameters
    ----------
    states : sequence of ForceStates
    terms : sequence of ResolvedTerm
        The law, its coefficients fitted anew at every step. Inertia among them where it is not declared.
    inertia : float or None
        kg·m².
    """
    stride = max(1, sum(s.n_samples for s in states) // ROWS)
    states = [replace(s, replicate=None) for s in states]

    def rows_at(
        time: float, kept: Sequence[NDArray[np.intp]], others: Sequence[ResolvedTerm] = ()
    ) -> list[_Rows]:
        moved = [shifted(s, time) for s in states]
        return _with_slopes([_rows(m, terms, others, inertia, k) for m, k in zip(moved, kept, strict=True)])

    def kept_at(time: float) -> list[NDArray[np.intp]]:
        return [np.flatnonzero(s.moving & shifted(s, time).moving)[::stride] for s in states]

    time = 0.0
    for _ in range(STEPS):
        rows = rows_at(time, kept_at(time))
        columns = np.vstack([np.column_stack([each.columns, each.slope]) for each in rows])
        step = float(scaled_least_squares(columns, np.concatenate([r.moment for r in rows]), 1e-12)[-1])
        time = float(np.clip(time + step, -POLICY.longest_delay, POLICY.longest_delay))
    known = {term.id for term in terms}
    rivals = load_catalogue("extended").union(load_catalogue("inertia")).resolve(reference_of(states))
    kept = kept_at(time)
    here = rows_at(time, kept)
    size = float(np.sqrt(np.mean(np.concatenate([each.moment for each in here]) ** 2)))
    cells = [_Cells.of(s, each.place, inertia, size) for s, each in zip(states, here, strict=True)]
    with_it = _evidence(cells, here, size)
    residual = np.concatenate([each.residual for each in here])
    error = _standard_error(*with_it)
    others = [term for term in rivals if term.id not in known]
    there = [replace(each, slope=each.others) for each in rows_at(0.0, kept, others)]
    predicts = _predicts(with_it, _evidence(cells, there, size))
    return ChannelDelay(time, error, float(np.sqrt(np.mean(residual**2))), predicts)


def _with_slopes(rows: Sequence[_Rows]) -> list[_Rows]:
    """Return rows with −dM/dt of the law that fits them: exact for the law, no noise of the moment in it."""
    columns, moment = (np.concatenate([getattr(each, n) for each in rows]) for n in ("columns", "moment"))
    fitted = scaled_least_squares(columns, moment, 1e-12)
    return [
        replace(r, slope=-(r.later @ fitted + r.known)[:, None], residual=r.moment - r.columns @ fitted)
        for r in rows
    ]


def _evidence(
    cells: Sequence[_Cells], rows: Sequence[_Rows], size: float
) -> tuple[Evidence, list[int], list[int]]:
    """Return rows as evidence, the places of the terms, and those of the further columns."""
    segments = -(-GROUPS // len(cells))
    turned = [Rotated(each, each.place, each.cyclic, size, segments) for each in cells]
    white = np.concatenate(
        [
            turn(cell.mean(np.column_stack([each.moment, each.columns, each.slope])))
            for turn, cell, each in zip(turned, cells, rows, strict=True)
        ]
    )
    labels = np.concatenate([1000 * i + turn.segment for i, turn in enumerate(turned)])
    group = np.unique(labels, return_inverse=True)[1]
    evidence = Evidence(white[:, 0], group, np.concatenate([turn.spread for turn in turned]))
    places, count = evidence.add(white[:, 1:]), rows[0].columns.shape[1]
    return evidence, places[:count], places[count:]


def _standard_error(evidence: Evidence, base: list[int], more: list[int]) -> float:
    """Return the standard error of a column's coefficient beside the terms.

    With x what the terms leave of it, in rows of variance 1 + σ²λ, σ the size of what the law lacks, it is Σ x·y/Σ x².
    """
    found = evidence.score(base)
    weight = 1 / np.sqrt(1 + found.size**2 * evidence.spread)
    basis = np.linalg.qr(evidence.columns[:, base] * weight[:, None])[0]
    column = evidence.columns[:, more[0]] * weight
    column = column - basis @ (basis.T @ column)
    square = float(column @ column)
    if not square > 0:
        raise np.linalg.LinAlgError("the delay is a combination of the terms")
    return float(np.sqrt(max(found.excess, 1.0) / square) / evidence.norms[more[0]])


Weighed = tuple[Evidence, list[int], list[int]]


def _predicts(with_it: Weighed, without: Weighed) -> bool:
    """Return whether runs are predicted better with the delay removed than with it, and no worse than with a rival.

    A rival is another term in its place; to be worse takes as much as to be better.
    """
    evidence, base, others = without
    later, before = with_it[0].score(with_it[1]), evidence.score(base)
    rivals = evidence.beside(base, others, before.size)
    if evidence.groups < 2:
        return True
    candidate = Candidate("delay", 0, np.empty(0), others[-1], False, True)
    search = Search(evidence, base, [candidate], lambda each, beside, size: each)
    best = max(each.total for each in rivals)
    return (
        search.wins(Chosen((candidate,), later), Chosen((), before)) and later.total > best - search.limits[0]
    )


@dataclass(frozen=True, eq=False)
class _Cells:
    """The moving rows of a run in cells along its motion: the phase of a period, or time.

    Parameters
    ----------
    index : ndarray of int, shape (n,)
        Cell of each row.
    place : ndarray, shape (m,)
        Middle of each cell, in cycles.
    cyclic : bool
    scale : ndarray, shape (m,)
        Noise of the mean of each cell, N·m.
    """

    index: NDArray[np.intp]
    place: Array
    cyclic: bool
    scale: Array

    @classmethod
    def of(cls, state: ForceStates, place: Array, inertia: float | None, size: float) -> _Cells:
        """Return the cells of rows at some places, in cycles, of a moment of an RMS ``size``."""
        cyclic = state.method == "periodic"
        place = place % 1.0 if cyclic else place
        width = max(CELL, float(np.ptp(place)) / CELLS)
        cell, index, count = np.unique(np.floor(place / width), return_inverse=True, return_counts=True)
        noise = np.hypot(
            np.nan_to_num(state.noise.moment), (inertia or 0.0) * np.nan_to_num(state.noise.acceleration)
        )
        return cls(
            index, (cell + 0.5) * width, cyclic, max(float(noise), LEAST_NOISE * size) / np.sqrt(count)
        )

    def mean(self, rows: Array) -> Array:
        """Return the means of the cells, shape (m, k)."""
        total = np.zeros((self.place.size, rows.shape[1]))
        np.add.at(total, self.index, rows)
        return np.asarray(total / np.bincount(self.index)[:, None])

    def white(self, rows: Array) -> Array:
        """Return rows of cells, (m,) or (m, k), in units of their noise."""
        return (rows.T / self.scale).T


@dataclass(frozen=True, eq=False)
class _Rows:
    """Moving rows of a run.

    Parameters
    ----------
    columns, later : ndarray, shape (n, p)
        Of the terms, and their time derivatives.
    others : ndarray, shape (n, q)
        Of terms that a delay may be taken for.
    moment, known : ndarray, shape (n,)
        Less the known moment of inertia, and the time derivative of that.
    place : ndarray, shape (n,)
        Along the motion, in cycles.
    slope : ndarray, shape (n, k)
        −dM/dt of the law, or what stands in its place.
    residual : ndarray, shape (n,)
    """

    columns: Array
    later: Array
    others: Array
    moment: Array
    known: Array
    place: Array
    slope: Array = field(default_factory=lambda: np.empty(0))
    residual: Array = field(default_factory=lambda: np.empty(0))


def _rows(
    states: ForceStates,
    terms: Sequence[ResolvedTerm],
    others: Sequence[ResolvedTerm],
    inertia: float | None,
    index: NDArray[np.intp],
) -> _Rows:
    half = 0.5 / states.sample_rate
    motion = (states.angle, states.rate, states.acceleration)
    inputs = {name: values[index] for name, values in states.inputs.items()}
    jerk = np.gradient(states.acceleration, 1 / states.sample_rate)
    slope = (states.rate, states.acceleration, jerk)
    here, after, before = (
        term_columns(
            terms, *(m[index] + offset * d[index] for m, d in zip(motion, slope, strict=True)), inputs=inputs
        )
        for offset in (0.0, half, -half)
    )
    # A lag of the moment shifts the inertia's moment as well. Where it is known it moves to the other side, but its
    # slope stays: without the jerk even 0.02 kg·m² of the paper's joint shows 0.04 ms that are not there.
    known = inertia or 0.0
    frequency = states.frequency or main_frequency(states.angle, states.sample_rate)
    branches = _branches(states, frequency)[index] if others else np.empty((index.size, 0))
    return _Rows(
        columns=here,
        later=(after - before) / (2 * half),
        others=np.column_stack([branches, term_columns(others, *(m[index] for m in motion), inputs=inputs)]),
        moment=states.moment[index] - known * states.acceleration[index],
        known=known * jerk[index],
        place=frequency * states.time[index],
    )


def _branches(states: ForceStates, frequency: float) -> Array:
    """Return what springs behind a damper, and behind a slider, are stretched by, shape (n, k)."""
    cycle = states.sample_rate / (2 * np.pi * frequency)
    found = [lagged(states.angle, share * cycle) for share in RELAXED]
    change, largest = np.diff(states.angle, prepend=states.angle[0]).tolist(), float(np.ptp(states.angle)) / 2
    for share in YIELDING:
        held = [0.0]
        for step in change:
            held.append(min(max(held[-1] + step, -share * largest), share * largest))
        found.append(np.array(held[1:]))
    return np.column_stack(found)


def reference_of(states: Sequence[ForceStates]) -> Reference:
    """Return the largest angle, rate and moment over the moving samples of all runs."""
    return Reference(
        *(
            float(max(np.abs(getattr(s, name)[s.moving]).max() for s in states))
            for name in ("angle", "rate", "moment")
        )
    )
