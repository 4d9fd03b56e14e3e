"""Motion of a structure with joints after a pulse.

Between events, steps of fixed length; where a joint sticks or breaks away, the step is cut at that
instant. The implicit midpoint rule (the average-acceleration rule for linear parts) loses no energy.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import sindyjoint.mechanics.transient_kernel as kernel
from sindyjoint.clock import STEP_SAMPLES, spend
from sindyjoint.errors import SimulationError, refuse
from sindyjoint.mechanics.crossing import Crossing, Stepper, not_converged, side_of
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.structure import Structure, craig_bampton
from sindyjoint.numeric import Array

# Steps per period of the first mode below which the motion is not resolved: its period is then 0.8 % wrong.
_STEPS_PER_PERIOD = 20


@dataclass(frozen=True, eq=False)
class Response:
    """Simulated motion of a structure.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    displacement : dict of str to ndarray, shape (n,)
        Deflection at each output point, m.
    force : ndarray, shape (n,)
        N.
    joints : tuple of str
    angle, rate, moment : ndarray, shape (joints, n)
        rad, rad/s, N·m.
    stuck : ndarray of bool, shape (joints, n)
    energy : ndarray, shape (n,)
        Kinetic and elastic energy, J.
    joint_dissipation : ndarray, shape (joints,)
        Work that each joint turned into heat over the whole time, J.
    beam_dissipation : float
        The same for the beams' material loss, J.
    step : float
        s.
    events : int
        Times a joint stuck, broke away or reversed.
    velocity : dict of str to ndarray, shape (n,)
        Of each output point, m/s.
    """

    time: Array
    displacement: dict[str, Array]
    force: Array
    joints: tuple[str, ...]
    angle: Array
    rate: Array
    moment: Array
    stuck: NDArray[np.bool_]
    energy: Array
    joint_dissipation: Array
    beam_dissipation: float
    step: float
    events: int
    velocity: dict[str, Array] = field(default_factory=dict)


def _check_step(structure: Structure, step: float, duration: float, sample_rate: float) -> int:
    first = structure.frequencies(1)[0]
    longest = 1 / (_STEPS_PER_PERIOD * first)
    refuse(
        [
            (
                not (0 < duration < np.inf and 0 < sample_rate < np.inf),
                f"duration {duration!r} s at {sample_rate!r} Hz; expected positive numbers",
            ),
            (not 0 < step < np.inf, f"step is {step!r} s; expected a positive number"),
            (
                step > longest,
                f"step is {step:g} s: too large for the first mode at {first:.3g} Hz; expected at most {longest:.3g} s "
                f"({_STEPS_PER_PERIOD} steps per period)",
            ),
        ]
    )
    return max(1, int(np.ceil(1 / (sample_rate * step) - 1e-9)))


def respond(
    structure: Structure,
    excitation: Excitation,
    at: str = "tip",
    *,
    duration: float = 20.0,
    sample_rate: float = 1000.0,
    step: float = 5e-4,
    points: Sequence[str] = ("tip",),
    modes: int = 12,
    limits: str | None = "softening",
) -> Response:
    """Simulate a structure under a force, from standstill.

    Parameters
    ----------
    structure : Structure
        As assembled; it is reduced to its joints, the points and `modes` fixed-interface modes.
    excitation : Excitation
        Force over time, N.
    at : str
        Point where it acts.
    duration, sample_rate : float
        s and Hz.
    step : float
        Largest time step, s; a sample is a whole number of steps.
    points : sequence of str
        Points whose deflection is returned.
    modes : int
    limits : {"softening", None}
        Whether crossing a joint's softening limit is an error.

    Returns
    -------
    Response

    Raises
    ------
    InputError
        For a point that is not there, or a step too large for the first mode.
    SimulationError
        When a joint passes its softening limit or a step finds no moment; carries the time.
    """
    parts = _check_step(structure, step, duration, sample_rate)
    reduced = craig_bampton(structure, [at, *points], modes)
    stepper = Stepper(reduced, reduced.point(at).copy(), 1 / (sample_rate * parts))
    record = _Record(stepper, excitation, round(duration * sample_rate) * parts)
    events = _advance(stepper, excitation, record, limits is not None)
    return _collect_response(stepper, points, parts, record, events)


#: Coordinates of a reduced structure, their rates, and the internal states of its joints, at one instant or several.
State = tuple[Array, Array, Array]


def trajectory(
    reduced: Structure,
    excitation: Excitation,
    at: str,
    duration: float,
    sample_rate: float,
    initial: State | None = None,
) -> State:
    """Return the states of a reduced structure at every step of one sample, from one or from standstill.

    Raises
    ------
    InputError, SimulationError
        As :func:`respond`.
    """
    _check_step(reduced, 1 / sample_rate, duration, sample_rate)
    stepper = Stepper(reduced, reduced.point(at).copy(), 1 / sample_rate)
    record = _Record(stepper, excitation, round(duration * sample_rate))
    if initial is not None:
        record.q[0], record.v[0], record.z[0] = initial
    _advance(stepper, excitation, record)
    return record.q, record.v, record.z


class _Record:
    """One row per step: force, its value before a jump, its mean over the next step; motion and joints.

    `moments` holds what each joint transfers and the bounds of its friction, `work` that of all steps and of the last.
    """

    def __init__(self, stepper: Stepper, excitation: Excitation, count: int):
        joints, n = stepper.structure.n_joints, len(stepper.mass)
        self.grid = stepper.step * np.arange(count + 1, dtype=np.float64)
        self.force, before_jump = excitation(self.grid), excitation(self.grid * (1 - 1e-12))
        self.forces = excitation.mean(self.grid[:-1], self.grid[1:]), before_jump
        self.q, self.v = np.zeros((2, count + 1, n))
        self.z = np.zeros((count + 1, joints, stepper.n_states))
        self.moments, self.stuck = np.zeros((count + 1, joints, 3)), np.zeros((count + 1, joints), np.bool_)
        self.work = np.zeros((2, joints, 2))


def _advance(stepper: Stepper, excitation: Excitation, record: _Record, limited: bool = True) -> int:
    """Fill the record from its first row on; return the number of events."""
    grid, q, v, z = record.grid, record.q, record.v, record.z
    hinges, joints, last = stepper.structure.hinges, stepper.structure.n_joints, len(grid) - 1
    ends = [hinge.law.softening_limit if limited else (-np.inf, np.inf) for hinge in hinges]
    bounds, direction = np.array(ends, dtype=np.float64).reshape(-1, 2), np.sign(v[0, :joints])
    still = direction == 0
    start = stepper.moments(direction, record.force[0], q[0], v[0], z[0])
    direction[still] = [side_of(row) for row in start[still]]
    start[still, 0] = np.clip(start[still, 0], start[still, 1], start[still, 2])
    record.moments[0] = start
    record.stuck[0] = direction == 0
    reached, events = 0, 0
    spend(STEP_SAMPLES * last * q.shape[1])
    while reached < last:
        rows = q, v, z, record.moments, record.stuck
        reached, reason, j = stepper.march(reached, last, direction, bounds, record.forces, rows, record.work)
        if reason == kernel.NOT_CONVERGED:
            raise not_converged(grid[reached], stepper.step)
        if reason == kernel.PAST_LIMIT:
            raise _limit_error(hinges[j].name, bounds[j], grid[reached])
        if reason == kernel.CHANGE:
            scale = max(1e-12, float(np.abs(v[: reached + 1, :joints]).max(initial=0.0)))
            state = q[reached], v[reached], z[reached]
            crossing = Crossing(stepper, excitation, grid[reached], state, direction, record.work[0], scale)
            crossing.run(stepper.step)
            reached += 1
            q[reached], v[reached], z[reached] = crossing.q, crossing.v, crossing.z
            now = stepper.moments(direction, record.forces[1][reached], q[reached], v[reached], z[reached])
            record.moments[reached], record.stuck[reached] = now, direction == 0
            events += crossing.events
            past = (q[reached, :joints] < bounds[:, 0]) | (q[reached, :joints] > bounds[:, 1])
            if past.any():
                raise _limit_error(hinges[np.argmax(past)].name, bounds[np.argmax(past)], grid[reached])
    return events


def _limit_error(name: str, bounds: Array, time: float) -> SimulationError:
    return SimulationError(
        f"joint {name!r} left its angle range ({bounds[0]:.4g} to {bounds[1]:.4g} rad) at t = {time:.6g} s: past the "
        "softening limit its tangent stiffness is negative; lower the force, or pass limits=None to follow it",
        time=float(time),
    )


def _collect_response(
    stepper: Stepper, points: Sequence[str], parts: int, record: _Record, events: int
) -> Response:
    structure, joints = stepper.structure, stepper.structure.n_joints
    middle = (record.v[1:] + record.v[:-1]) / 2
    lost = float(np.sum((middle @ stepper.damping) * middle)) * stepper.step
    keep = slice(None, None, parts)
    q, v = record.q[keep], record.v[keep]
    energy = 0.5 * (
        np.einsum("ti,ti->t", v @ structure.mass, v) + np.einsum("ti,ti->t", q @ structure.stiffness, q)
    )
    for j, hinge in enumerate(structure.hinges):
        energy += _integrate_elastic_energy(hinge.law, q[:, j])
    rows = {name: structure.point(name) for name in points}
    return Response(
        time=record.grid[keep], displacement={name: q @ row for name, row in rows.items()},
        force=record.force[keep], joints=tuple(hinge.name for hinge in structure.hinges),
        angle=q[:, :joints].T, rate=v[:, :joints].T, moment=record.moments[keep, :, 0].T, stuck=record.stuck[keep].T,
        energy=energy, joint_dissipation=record.work[0, :, 1], beam_dissipation=lost, step=stepper.step, events=events,
        velocity={name: v @ row for name, row in rows.items()},
    )  # fmt: skip


def _integrate_elastic_energy(law: Any, angle: Array) -> Array:
    """Energy stored in the memoryless elastic part of a law.

    Its moment at standstill, in the middle of the friction interval, integrated from zero by Gauss' rule of four
    points.
    """
    nodes, weights = np.polynomial.legendre.leggauss(4)
    points = np.outer((nodes + 1) / 2, angle)
    zero = np.zeros(points.size)
    state = np.zeros((law.n_states, points.size))
    return angle * (weights / 2 @ law.moment(points.ravel(), zero, zero, state).reshape(points.shape))
