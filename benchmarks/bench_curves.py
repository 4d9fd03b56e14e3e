"""Curves of a structure beside the time simulation of the same rig, steady state by steady state.

For the pulse rig and the four-panel wing, at the three default levels: amplitude of the first harmonic by harmonic
balance over that by simulation, at frequencies over the band, and the processor time of either. Then the pulse rig with
little friction and damping, whose response folds: the frequencies at which a sine stepped up and down jumps, over those
of the folds; and the pulse rig with a Jenkins element in its joint.

    python -m benchmarks.bench_curves [pulse-rig|four-panel-wing|folds|jenkins ...] [--json FILE]
"""

from __future__ import annotations

import argparse
import os
import time

# On a busy machine threads of BLAS wait for each other and the processor's time is theirs.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from benchmarks.resumed import with_rows, write_rows  # noqa: E402
from sindyjoint import curves  # noqa: E402
from sindyjoint.mechanics import FormulaLaw, PaperLaw, SumLaw  # noqa: E402
from sindyjoint.mechanics.excitation import sampled  # noqa: E402
from sindyjoint.mechanics.rigs import Rig, load_rig  # noqa: E402
from sindyjoint.mechanics.transient import respond  # noqa: E402
from sindyjoint.mechanics.virtual_rig import with_laws  # noqa: E402
from sindyjoint.substructure.forced import ForcedResponse, frequency_response  # noqa: E402
from sindyjoint.substructure.harmonic_balance import Balance  # noqa: E402

PER_PERIOD, STEPS_PER_PERIOD = 100, 1600
# Periods that a simulation has, and over how many its force rises.
PERIODS, RISE = 400, 60
# Where the two are held beside each other: shares of the band in which a joint moves at least a tenth of its most.
# Where all stick, the response is linear, and only the beams' 0.2 % would end what a start leaves.
SHARES, MOVES = (0.0, 0.25, 0.5, 0.75, 1.0), 0.1
FOLDING = PaperLaw(k1=6.066e3, k2=-1.927e5, k3=-2.684e9, c1=3.0, M_F=0.15, name="joint")
FORCE = 0.15
SLIDER, YIELDS = 1500.0, 1e-4  # N·m/rad, rad, of a Jenkins element beside the joint's law
# Steps of a sine that is stepped over a fold, and periods of each: near it the motion takes long to settle. It begins
# and ends as far from the fold as the shares say; what the first step shows is still settling.
FOLD_STEP, FOLD_PERIODS = 1e-3, 300
PAST = {"up": (0.995, 1.003), "down": (1.01, 0.997)}


def amplitudes(rig: Rig, frequencies: np.ndarray, periods: int, force: float) -> np.ndarray:
    """Return the first harmonic at the driven point in the last period of each step of a stepped sine, m."""
    rate = PER_PERIOD * float(np.mean(frequencies))
    phase, parts = 0.0, []
    ends = []
    for frequency in frequencies:
        n = round(periods * rate / frequency)
        parts.append(phase + 2 * np.pi * frequency / rate * np.arange(n))
        phase = parts[-1][-1] + 2 * np.pi * frequency / rate
        ends.append(sum(map(len, parts)))
    phases = np.concatenate(parts)
    rise = np.minimum(np.arange(phases.size) / (RISE * PER_PERIOD), 1.0)
    done = _deflection(rig, force * rise * np.sin(phases), rate)
    found = []
    for end, frequency in zip(ends, frequencies, strict=True):
        # Over the last four periods, by least squares: a step's period is no whole number of samples.
        last = slice(end - round(4 * rate / frequency), end)
        columns = np.column_stack([np.sin(phases[last]), np.cos(phases[last]), np.ones(phases[last].size)])
        weights = np.linalg.lstsq(columns, done[last], rcond=None)[0]
        found.append(np.hypot(*weights[:2]))
    return np.array(found)


def _deflection(rig: Rig, force: np.ndarray, rate: float) -> np.ndarray:
    done = respond(
        rig.structure(), sampled(np.append(force, force[-1]), rate), rig.at, duration=force.size / rate,
        sample_rate=rate, step=PER_PERIOD / STEPS_PER_PERIOD / rate, points=(rig.at,), modes=rig.modes, limits=None,
    )  # fmt: skip
    return done.displacement[rig.at]


def on_branch(level: ForcedResponse, frequency: float) -> float:
    """Return the amplitude of a curve without folds at a frequency, m."""
    from scipy.interpolate import CubicSpline

    order = np.argsort(level.frequency)
    return float(np.exp(CubicSpline(level.frequency[order], np.log(level.amplitude[order]))(frequency)))


def row(structure: str, level: str, ratios: list[float], *seconds: float) -> dict:
    """Return the row of a curve: the largest difference from the simulation, and the times of either, s."""
    told = [f"{each:.1f}" for each in seconds] or ["–"]
    return dict(structure=structure, level=level, apart=max(abs(ratio - 1) for ratio in ratios), seconds=told)


def levels_of(name: str) -> list[dict]:
    """Print a line per level of a rig, and return them as rows."""
    rig = load_rig(name)
    began = time.process_time()
    made = curves(rig, modes=1)
    print(f"{name}: mode 1 and three levels in {time.process_time() - began:.1f} s", flush=True)
    structure = rig.structure()
    balance, rows = Balance.of(structure, rig.at), []
    for level in made.levels:
        began = time.process_time()
        band = made.levels[0].frequency[0], made.locked[0] * 1.15
        curve = frequency_response(balance, level.force, band, refine=True)
        balanced = time.process_time() - began
        ends = curve.frequency[curve.angle.max(axis=0) > MOVES * curve.angle.max()][[0, -1]]
        chosen = [*(ends[0] + share * np.ptp(ends) for share in SHARES), curve.peak[0]]
        began = time.process_time()
        ratios = [
            on_branch(curve, one) / amplitudes(rig, np.array([one]), PERIODS, level.force)[0]
            for one in chosen
        ]
        spent = time.process_time() - began
        rows.append(row(name, f"{level.force:.2g} N", ratios, balanced, spent))
        print(
            f"  {level.force:g} N: balance over simulation {' '.join(f'{one:.4f}' for one in ratios)} (last: peak); "
            f"largest difference {rows[-1]['apart']:.2%}; {balanced:.1f} s for the curve, {spent:.1f} s for six "
            "points simulated",
            flush=True,
        )
    return rows


def folds() -> list[dict]:
    """Print the frequencies of the folds over those at which a stepped sine jumps, and return them as rows."""
    rows = []
    rig = with_laws(load_rig("pulse-rig"), lambda hinge: FOLDING)
    curve = frequency_response(Balance.of(rig.structure(), rig.at), FORCE, (3.6, 4.3))
    print(
        f"pulse rig, c1 = {FOLDING.c1:g}, M_F = {FOLDING.M_F:g} at {FORCE:g} N: folds at", curve.folds, "Hz"
    )
    print(f"  largest angle {curve.angle.max():.3g} rad, softening from {FOLDING.softening_angle:.3g} rad")
    low, high = min(curve.folds), max(curve.folds)
    for name, fold in (("up", high), ("down", low)):
        start, stop = PAST[name]
        steps = fold * np.arange(start, stop, FOLD_STEP * np.sign(stop - start))
        found = amplitudes(rig, steps, FOLD_PERIODS, FORCE)
        jump = 1 + int(np.argmax(np.abs(np.diff(np.log(found[1:])))))
        at = (steps[jump] + steps[jump + 1]) / 2
        print(
            f"  stepped {name}: jumps from {1e3 * found[jump]:.3f} to {1e3 * found[jump + 1]:.3f} mm between "
            f"{steps[jump]:.4f} and {steps[jump + 1]:.4f} Hz; fold over jump {fold / at:.4f}",
            flush=True,
        )
        rows.append(row("pulse rig that folds", f"jump {name}", [fold / at]))
    return rows


def jenkins() -> list[dict]:
    """Print amplitudes of the pulse rig with a Jenkins element beside the joint's law over those simulated; as rows."""
    from sympy import Abs, Heaviside, Symbol

    z, omega = Symbol("z", real=True), Symbol("omega", real=True)
    full = Heaviside(Abs(z) - YIELDS, 1) * Heaviside(z * omega, 0)
    slider = FormulaLaw(SLIDER * z, {}, {"z": omega * (1 - full)})
    rig = with_laws(load_rig("pulse-rig"), lambda hinge: SumLaw(hinge.law, slider))
    balance = Balance.of(rig.structure(), rig.at)
    sticking = float(rig.structure().frequencies(1, locked=True)[0])
    rows = []
    for force in (0.8, 1.2):
        curve = frequency_response(balance, force, (0.7 * sticking, 1.15 * sticking))
        ratios = [
            on_branch(curve, one) / amplitudes(rig, np.array([one]), PERIODS, force)[0]
            for one in curve.peak[0] * np.array([0.97, 1.0, 1.03])
        ]
        print(
            f"pulse rig with a Jenkins element, {force:g} N:",
            " ".join(f"{one:.4f}" for one in ratios),
            flush=True,
        )
        rows.append(row("pulse rig with a Jenkins element", f"{force:g} N", ratios))
    return rows


DOERS = {"folds": folds, "jenkins": jenkins}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("asked", nargs="*", default=["pulse-rig", "four-panel-wing", *DOERS])
    given = with_rows(parser).parse_args()
    made = [DOERS[asked]() if asked in DOERS else levels_of(asked) for asked in given.asked]
    write_rows(given.json, [row for rows in made for row in rows])
