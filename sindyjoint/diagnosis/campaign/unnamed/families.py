"""Generic families of laws, none of them of the catalogue: what any law without memory, with one, or of a run can do.

A surface over (θ, θ̇) stands for every memoryless law. Stop operators of several thresholds (a Prandtl-Ishlinskii
model; Visintin, Differential Models of Hysteresis, 1994, chapter III) and relaxations of several times (a generalised
Maxwell model) stand for laws with a memory. Columns in frequency, time and acceleration stand for what differs between
runs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.equation.terms import Reference
from sindyjoint.numeric import Array

# Knots of the surface: of each sheet over (|θ̇|, θ), and of what changes quickly along θ or along |θ̇| alone.
SHEET = (9, 5)
FINE_ANGLE = 49
FINE_RATE = 15
# Thresholds, as shares of the largest angle; stops that first do nothing, as shares of the threshold.
THRESHOLDS = np.geomspace(0.015, 0.8, 9)
GAPS = (0.6, 0.85)
# Relaxation times, in units of the motion's own 1/ω.
FORGETTING = np.array([0.15, 0.4, 1.0, 2.5, 6.0])
# Two signals that point the same way within this are one.
ROUNDING = 1e-9
TURNS = 3


def surface_columns(run: GapRun, reference: Reference) -> Array:
    """Return a basis of functions of (θ, θ̇) that may jump at θ̇ = 0, shape (m, k); piecewise linear between knots."""
    x, v = run.angle / (reference.angle or 1.0), run.rate / (reference.rate or 1.0)
    forward = (v > 0)[:, None]
    angle, rate, fine_angle, fine_rate = _knots()
    sheet = (hats(x, angle)[:, :, None] * hats(np.abs(v), rate)[:, None, :]).reshape(x.size, -1)
    along, across = hats(x, fine_angle), hats(np.abs(v), fine_rate)
    return np.hstack(
        [
            sheet * forward,
            sheet * ~forward,
            along,
            along * np.sign(v)[:, None],
            across * forward,
            across * ~forward,
        ]
    )


def surface_roughness() -> Array:
    """Return the quadratic form c'Rc ≈ ∫|∂²f|² of the surface's coefficients, shape (k, k)."""
    angle, rate, fine_angle, fine_rate = _knots()
    sheet = np.kron(_bend(angle.size, 2.0), np.eye(rate.size)) + np.kron(
        np.eye(angle.size), _bend(rate.size, 1.0)
    )
    along, across = _bend(fine_angle.size, 2.0), _bend(fine_rate.size, 1.0)
    from scipy.linalg import block_diag

    rough: Array = block_diag(sheet, sheet, along, along, across, across)
    return rough


def hats(x: Array, knots: Array) -> Array:
    """Return piecewise linear hat functions on knots, constant beyond the ends, shape (n, knots)."""
    place = np.interp(x, knots, np.arange(knots.size))
    return np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(knots.size)[None, :]))


def _knots() -> tuple[Array, Array, Array, Array]:
    # Stribeck friction lives near rest: knots of the rate lie closer there.
    return (
        np.linspace(-1, 1, SHEET[0]),
        np.linspace(0, 1, SHEET[1]),
        np.linspace(-1, 1, FINE_ANGLE),
        np.linspace(0, 1, FINE_RATE) ** 2,
    )


def _bend(count: int, length: float) -> Array:
    """Return D'D of second differences, in the scale of the integral of the second derivative squared."""
    second = np.diff(np.eye(count), 2, axis=0)
    return second.T @ second * ((count - 1) / length) ** 3


def relaxation_columns(run: GapRun, pulse: float) -> Array:
    """Return the angle as Maxwell branches of several times forget it, ż = θ̇ − z/τ, shape (m, 5).

    ``pulse`` is the angular frequency that all runs have on the whole, rad/s.
    """
    motion = run.motion
    return forgotten(motion.angle, motion.step, FORGETTING / pulse, motion.repeats)[motion.keep]


def stop_columns(run: GapRun, largest: float) -> Array:
    """Return stop operators of several thresholds, alone and behind a gap, shape (m, 27).

    ``largest`` is the largest angle of all runs, rad.
    """
    motion, thresholds = run.motion, largest * THRESHOLDS
    z = stopped(motion.angle, thresholds, motion.repeats)[motion.keep]
    return np.hstack([z, *(np.sign(z) * np.maximum(np.abs(z) - gap * thresholds, 0.0) for gap in GAPS)])


@njit(cache=True, no_cfunc_wrapper=True)
def stopped(angle, thresholds, repeats):
    """Return stop operators along an angle, z ← min(max(z + Δθ, −r), r), shape (n, thresholds), rad.

    An angle that ``repeats`` is one period, and is run through until its states have settled.
    """
    states = np.empty((angle.size, thresholds.size))
    z = np.zeros(thresholds.size)
    for turn in range(TURNS if repeats else 1):
        for i in range(angle.size):
            change = angle[i] - angle[i - 1] if i > 0 else (angle[0] - angle[-1] if turn > 0 else 0.0)
            for j in range(thresholds.size):
                z[j] = min(max(z[j] + change, -thresholds[j]), thresholds[j])
                states[i, j] = z[j]
    return states


@njit(cache=True, no_cfunc_wrapper=True)
def forgotten(angle, step, times, repeats):
    """Return relaxations along an angle, exact where it is linear between samples, shape (n, times), rad."""
    states = np.empty((angle.size, times.size))
    z = np.zeros(times.size)
    for turn in range(TURNS if repeats else 1):
        for i in range(angle.size):
            change = angle[i] - angle[i - 1] if i > 0 else (angle[0] - angle[-1] if turn > 0 else 0.0)
            for j in range(times.size):
                kept = np.exp(-step / times[j])
                z[j] = kept * z[j] + change * (1 - kept) * times[j] / step
                states[i, j] = z[j]
    return states


def frequency_columns(run: GapRun, middle: float) -> Array:
    """Return stiffness and damping that grow with the excitation frequency, from ``middle`` Hz, shape (m, 2)."""
    # Frequencies that differ by rounding are one.
    off = round(run.motion.frequency - middle, 9)
    return np.column_stack([off * run.angle, off * run.rate])


def inertial_columns(run: GapRun) -> Array:
    """Return the acceleration: at one frequency it is a stiffness, shape (m, 1).

    Zero where the run moves freely: its moment is then that of its own inertia, which any multiple of it would explain.
    """
    own, target = run.acceleration, run.target
    cosine = float(own @ target) / max(float(np.linalg.norm(own) * np.linalg.norm(target)), 1e-300)
    return np.zeros((own.size, 1)) if abs(cosine) > 1 - ROUNDING else own[:, None]


def time_columns(run: GapRun, middle: float) -> Array:
    """Return moment, stiffness and damping that grow along the run, and stiffness over all runs, shape (m, 4)."""
    time = np.round(run.motion.time[run.motion.keep] - middle, 9)
    return np.column_stack([time, time * run.angle, time * run.rate, (time + run.motion.began) * run.angle])


def own_pulse(runs: Sequence[GapRun]) -> float:
    """Return RMS rate over RMS angle of all runs, rad/s."""
    angle, rate = (np.concatenate([getattr(r, name) for r in runs]) for name in ("angle", "rate"))
    return float(np.sqrt(np.mean(rate**2) / max(float(np.mean(angle**2)), 1e-300))) or 1.0
