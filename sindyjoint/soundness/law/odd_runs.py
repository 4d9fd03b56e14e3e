"""Runs held against the others: the law that all others have in common, and the ones that depart from it or drift."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.limits import SOUNDNESS
from sindyjoint.numeric import Array, rms
from sindyjoint.soundness import Finding, Words
from sindyjoint.soundness.detectors.course import drift_of
from sindyjoint.soundness.law import (
    Motions,
    Rows,
    Scale,
    inverted,
    least,
    misfit,
    rows_of,
    scale_of,
    solve,
    solved,
)
from sindyjoint.soundness.law.filters import INVERSES

# What units are mistaken by: degrees, thousandths, kgf, lbf, inches.
MISTAKES = {
    "rad and deg": 180 / np.pi,
    "a unit and its thousandth": 1e3,
    "N and kgf": 9.80665,
    "N and lbf": 4.4482216,
    "mm and inch": 25.4,
}
# Parts of a run whose mean residuals are followed, and the fewest samples of one.
PARTS, FEWEST = 24, 5
OTHER_SIGN = "k1, c1 and M_F of this run have the other sign"
REVERSE = "reverse the channel (gain = -1), or leave the run out"


def find_other_scales(runs: Motions, inertia: float | None, words: Words) -> tuple[list[Finding], Motions]:
    """Return findings on the runs, half of them at most, that are in another unit than the rest, and the rest."""
    before = misfit(runs, inertia) if len(runs) >= SOUNDNESS.fewest else 0.0
    if before < SOUNDNESS.departs / np.sqrt(max(len(runs), 1)):
        return [], runs
    tried = [
        (misfit(runs.scaled(channel, np.where(group, 1 / factor, 1.0)), inertia), group, channel, factor)
        for group, channel, factor in _mistaken(runs)
    ]
    if not tried:
        return [], runs
    left, group, channel, factor = min(tried, key=lambda one: one[0])
    if left > min(SOUNDNESS.departs, np.sqrt(SOUNDNESS.explains) * before):
        return [], runs
    fits = f"one law leaves {100 * before:.2g} % of the {words.of('moment')}, {100 * left:.2g} % with that undone"
    if group.sum() > 1:
        fits = f"so are {group.sum()} of {group.size} runs; {fits}"
    mistake = min(
        MISTAKES, key=lambda name: abs(abs(np.log(factor)) - np.log(MISTAKES[name])) if factor > 0 else 0
    )
    kind, extent, effect, remedy = (
        (
            "reversed_sign",
            f"its {words.of(channel)} has the other sign than in the other runs: {fits}",
            OTHER_SIGN,
            REVERSE,
        )
        if factor < 0
        else (
            "gain_differs",
            f"its {words.of(channel)} is {factor:.4g} times that of the other runs, as where {mistake} are mistaken: "
            f"{fits}",
            "k1, k3, c1 and M_F are a mean of two scales",
            f"give the {words.of(channel)} of these runs the unit of the others, or the others theirs",
        )
    )  # fmt: skip
    odd = np.flatnonzero(group)
    found = [Finding(kind, runs.names[i], channel, "stops", extent, effect, remedy) for i in odd]
    return found, runs.take(np.flatnonzero(~group).tolist())


def _mistaken(runs: Motions) -> Iterator[tuple[NDArray[np.bool_], str, float]]:
    """Yield groups of runs, a channel, and what it may be multiplied by: groups parted by sign or by size of M/θ.

    The size of M/θ is no proof, for a joint's stiffness depends on the level: it says where to look, the law decides.
    """
    load, angle = (x - x.mean(axis=1, keepdims=True) for x in (runs.moment, runs.angle))
    down = np.mean(load * angle, axis=1) < 0
    if 0 < down.sum() < len(runs):
        yield down if down.sum() <= len(runs) / 2 else ~down, "moment", -1.0
    size = np.log(np.maximum(np.std(load, axis=1), 1e-300) / np.maximum(np.std(angle, axis=1), 1e-300))
    order = np.sort(size)
    known = np.array(list(MISTAKES.values()))
    # Places at which runs are parted by their stiffness, and mistakes that are tried at each.
    for at in np.argsort(-np.diff(order))[:3]:
        above = size > order[at]
        group = above if above.sum() <= len(runs) / 2 else ~above
        apart = float(np.median(size[group]) - np.median(size[~group]))
        for factor in known[np.argsort(np.abs(np.log(known) - abs(apart)))[:2]]:
            yield group, "moment", float(factor ** np.sign(apart))
            yield group, "angle", float(factor ** -np.sign(apart))


def find_odd_runs(runs: Motions, inertia: float | None, words: Words) -> tuple[list[Finding], Motions]:
    """Return findings on runs that differ from the others, with what explains it, and the motions of the others."""
    alike = list(range(len(runs)))
    odd: list[int] = []
    common = 0.0
    while len(alike) >= SOUNDNESS.fewest and len(odd) <= len(runs) // 3:
        some = runs.take(alike)
        rows = rows_of(some, scale_of(some), inertia)
        # Two runs may have each other's channel.
        found = _departing(rows, 1) or (_departing(rows, 2) if len(alike) >= 2 * SOUNDNESS.fewest else None)
        if found is None:
            break
        common = found[1]
        odd += [alike[i] for i in found[0]]
        alike = [i for i in alike if i not in odd]
    others = runs.take(alike)
    if not odd or len(alike) < 2:
        return [], others
    held = Held(runs, tuple(alike), inertia, common)
    return [told for i in odd if (told := _describe(i, held, words))], others


def _departing(rows: Rows, size: int) -> tuple[tuple[int, ...], float] | None:
    """Return the runs, ``size`` of them, without which the others have a law in common as they have not with them.

    And the RMS that this law leaves of the others.
    """
    products, count = rows.products, len(rows.products)
    everything = float(np.sqrt(solve(products)[1]))
    if everything < SOUNDNESS.departs / np.sqrt(count):
        return None
    every, pooled = np.array(list(combinations(range(count), size))), products.sum(axis=0)
    rests = [
        solved(pooled - products[each].sum(axis=1), count - size)[1] for each in np.array_split(every, count)
    ]
    index = tuple(every[np.argmin(np.concatenate(rests))].tolist())
    law, rest = solve(np.delete(products, index, axis=0))
    departure, common = min(rows.left_by(law, i) for i in index), float(np.sqrt(rest))
    alike = rest < min(SOUNDNESS.explains * everything**2, SOUNDNESS.tolerated**2)
    apart = departure > max(SOUNDNESS.departs, SOUNDNESS.fewest * common)
    return (index, common) if alike and apart else None


@dataclass(frozen=True, eq=False)
class Held:
    """Runs held against the law of some of them.

    Parameters
    ----------
    runs : Motions
    alike : tuple of int
        Those that have a law in common.
    inertia : float or None
    common : float
        RMS that their law leaves of them.
    """

    runs: Motions
    alike: tuple[int, ...]
    inertia: float | None
    common: float

    @cached_property
    def scale(self) -> Scale:
        """Scale of the runs that are alike."""
        return scale_of(self.runs.take(self.alike))

    def law_of(self, index: tuple[int, ...]) -> Array:
        """Return the coefficients of the law of some runs."""
        return solve(self.rows(self.runs.take(index)).products)[0]

    @cached_property
    def law(self) -> Array:
        """Coefficients of the law of those that are alike."""
        return self.law_of(self.alike)

    def rows(self, runs: Motions) -> Rows:
        """Return rows of runs."""
        return rows_of(runs, self.scale, self.inertia)

    def left_of(self, run: Motions) -> float:
        """Return the RMS that the law leaves of a single run, in parts of its moment's."""
        return self.rows(run).left_by(self.law)

    def ways(self, index: int) -> tuple[float, dict[str, tuple[float, float]]]:
        """Return the RMS by which a run departs, and how far one number each restores it, and what that leaves.

        A factor on the moment or on the angle, a delay of the moment, s, and its zero; and the time of a first-order
        low-pass, s, on the moment or, below zero, on the angle.
        """
        run = self.runs.take([index])
        rows = self.rows(run)
        expected, target = rows.columns[0] @ self.law, rows.target[0]
        gain = float(target @ expected / max(float(expected @ expected), 1e-300))
        swing, one = float(np.abs(run.angle).max()) / self.scale.angle, rows.columns[0, :, 0]
        zero = float(one @ (target - expected) / (one @ one))
        grid = np.unique([-1.0, *np.geomspace(0.5, 2.0, 25), *swing * np.geomspace(0.2, 5.0, 25)])
        longest = SOUNDNESS.minor_share * 2 * np.pi * float(np.std(run.angle) / np.std(run.rate))

        def left_by_lag(time: float) -> float:
            channel = "moment" if time > 0 else "angle"
            return self.left_of(run.filtered(channel, INVERSES["low_pass"](run.lines, abs(time))))

        ways = {
            "moment": (gain, rms(target - gain * expected)),
            "angle": least(lambda g: self.left_of(run.scaled("angle", 1 / g)), grid),
            "delay": least(lambda t: self.left_of(run.advanced(t)), longest * np.linspace(-1, 1, 21)),
            "zero": (zero, rms(target - expected - zero * one)),
        }
        if run.frequency is not None:
            ways["lag"] = least(left_by_lag, longest * np.linspace(-1, 1, 21))
        return rms(target - expected), ways

    def departs(self, run: int) -> bool:
        """Return whether a run departs where the others can say what is expected, and its kin does not depart alike.

        What is expected of a row x is as uncertain as xᵀ(XᵀX)⁻¹x of the others' rows, a run's worth of rows counting as
        one: beyond their motion that is large. Two runs leave open which of three is odd, and what all runs of a
        frequency show is the joint's.
        """
        swing = np.ptp(self.runs.angle, axis=1)
        if abs(np.log(swing[run] / np.median(swing))) > np.log(SOUNDNESS.many_times):
            return True
        rows, of_others = self.rows(self.runs.take([run])), self.rows(self.runs.take(self.alike)).products
        columns = rows.columns[0]
        leverage = np.einsum("ij,jk,ik->i", columns, inverted(of_others.sum(axis=0)[:-1, :-1]), columns)
        if len(self.alike) < SOUNDNESS.fewest or np.median(leverage) > SOUNDNESS.many_times:
            return False
        within = rms((rows.target[0] - columns @ self.law) / np.sqrt(1 + leverage))
        return within > max(SOUNDNESS.departs, SOUNDNESS.fewest * self.common) and not self._kin_too(run)

    def _kin_too(self, run: int) -> bool:
        """Return whether all other runs of its frequency depart from the law of other frequencies as well."""
        if self.runs.frequency is None:
            return False
        same = np.abs(np.log(self.runs.frequency / self.runs.frequency[run])) < np.log1p(
            SOUNDNESS.small_share
        )
        kin = [i for i in np.flatnonzero(same).tolist() if i != run]
        rest = tuple(i for i in self.alike if not same[i])
        if not kin or len(rest) < 2:
            return False
        law = self.law_of(rest)
        left = [self.rows(self.runs.take([i])).left_by(law) for i in (run, *kin)]
        return min(left[1:]) > SOUNDNESS.explains * left[0]


def _describe(index: int, held: Held, words: Words) -> Finding | None:
    """Return what restores the law, or comes closest to it, or that nothing does; None where it may be the joint's."""
    departure, ways = held.ways(index)
    name, run = min(ways, key=lambda each: ways[each][1]), held.runs.names[index]
    # A low-pass lags as a delay does, by less at the higher harmonics: where these do not tell, both are said.
    lag, lag_left = ways.get("lag", (0.0, np.inf))
    told = min(ways["delay"][1], lag_left) ** 2 <= SOUNDNESS.explains * max(ways["delay"][1], lag_left) ** 2
    name = "delay" if name == "lag" and not told else name
    number, left = ways[name]
    # Of the RMS: a single number is to account for a single run. Beside as much again its size would be unknown.
    closest = left <= min(SOUNDNESS.explains * departure, SOUNDNESS.unknown)
    if not (closest or held.departs(index)):
        return None
    # It does where it leaves little, or as much as the law leaves of the others.
    little = max(SOUNDNESS.minor_share * departure, SOUNDNESS.fewest * held.common)
    explained = closest and left <= little
    said = f"(it departs by {100 * departure:.3g} %, they do by {100 * held.common:.2g} %)"
    if name in ("delay", "lag", "zero") or not explained:
        low_pass = (
            f"without a low-pass with a corner of {1 / max(2 * np.pi * abs(lag), 1e-300):.3g} Hz on its "
            f"{words.of('moment' if lag > 0 else 'angle')}"
        )
        changed = {
            "delay": f"where it comes {1e3 * abs(number):.3g} ms {'earlier' if number > 0 else 'later'}"
            f"{'' if told else f' or, as its harmonics leave open, {low_pass}'}",
            "lag": low_pass,
            "zero": f"with {-number:.3g} {words.unit('moment')} added to it",
        }.get(name, f"where its {words.of(name)} is divided by {number:.3g}")
        late = explained and {"delay": "channel_delay", "lag": "low_pass"}.get(name)
        agree = "they agree" if explained else "they come closest"
        nearest = f"; {agree} {changed}; that leaves {100 * left:.2g} %"
        return Finding(
            late or "run_differs",
            run,
            ("angle" if name == "lag" and lag < 0 else "moment") if late else None,
            "biases",
            f"its {words.of('moment')} is not what the law of the other runs gives {said}"
            f"{nearest if closest else ''}",
            "the coefficients (k1, k3, c1, M_F) are a mean of two joints or two set-ups",
            "compare trigger and filters of that run with the others', and repeat it or leave it out"
            if late
            else "look at what was changed before that run; leave it out, or diagnose it apart",
        )
    if number < 0:
        return Finding(
            "reversed_sign",
            run,
            name,
            "stops",
            f"its {words.of(name)} is that of the other runs times {number:.3g}",
            OTHER_SIGN,
            REVERSE,
        )
    return Finding(
        "gain_differs",
        run,
        name,
        "biases" if max(number, 1 / number) < SOUNDNESS.clearly else "stops",
        f"its {words.of(name)} is {number:.4g} times what the law of the other runs gives {said}",
        "k1, k3, c1 and M_F are drawn towards that run",
        "compare gain and unit of that run with the others'; correct it or leave it out",
    )


def find_drifts(runs: Motions, alike: Motions, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield runs of which the law that the others have in common leaves a straight line over time.

    Parameters
    ----------
    runs : Motions
        Those that are looked at.
    alike : Motions
        Those that have a law in common.
    inertia : float or None
    words : Words
    """
    scale = scale_of(alike)
    law = solve(rows_of(alike, scale, inertia).products)[0]
    rows = rows_of(runs, scale, inertia)
    for index, name in enumerate(runs.names):
        moving = np.any(rows.columns[index] != 0, axis=1)
        parts = (runs.place[index] * PARTS).astype(int)
        part = parts[moving]
        # In amplitudes of a sinusoid.
        residual = ((rows.target[index] - rows.columns[index] @ law) / np.sqrt(2))[moving]
        known = np.flatnonzero(np.bincount(part, minlength=PARTS) >= FEWEST)
        if known.size < PARTS // 2:
            continue
        slope = drift_of(_means(part, residual)[known], SOUNDNESS.tolerated, place=known)
        total = (slope or 0.0) * PARTS
        # Of a law that leaves much the mean moves as well, as drive and motion change along a sweep.
        if slope is None or np.var(residual) - total**2 / 12 > SOUNDNESS.minor_share**2:
            continue
        moves = {
            channel: abs(np.polyfit(np.arange(PARTS), _means(parts, signal[index]), 1)[0])
            / max(float(np.std(signal[index])), 1e-300)
            for channel, signal in (("moment", runs.moment), ("angle", runs.angle))
        }
        # The channel whose own mean moves along, at least twice as far.
        one, other = sorted(moves, key=moves.__getitem__, reverse=True)
        drifting = one if moves[one] > 2 * moves[other] else None
        which = "" if drifting else f"; the zero of {words.of('moment')} or {words.of('angle')} does"
        yield words.finding(
            "drift",
            name,
            drifting,
            "biases",
            f"the law of all runs leaves a {words.of('moment')} that drifts over the run, by {100 * abs(total):.2g} % "
            f"of its amplitude{which}",
            "let the amplifiers warm up, or remove a straight line from the channel before",
        )


def _means(part: Array, values: Array) -> Array:
    count = np.maximum(np.bincount(part, minlength=PARTS), 1)
    return np.asarray(np.bincount(part, values, minlength=PARTS) / count)
