"""Motion of a structure with joints after a pulse.

Between events, steps of fixed length; where a joint comes to rest or breaks away, the step is cut at that
instant. The implicit midpoint rule (the average-acceleration rule for linear parts) loses no energy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics import transient_kernel as kernel
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.laws import as_compiled, softening_limit
from sindyjoint.mechanics.structure import Structure, craig_bampton

Array = NDArray[np.float64]

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


class _Stepper:
    """The matrices of a reduced structure and what follows from them for each set of stuck joints."""

    def __init__(self, structure: Structure, load: Array, step: float):
        self.structure, self.load, self.step = structure, load, step
        omega = 2 * np.pi * structure.frequencies(1)[0]
        self.mass, self.stiffness = structure.mass, structure.stiffness
        self.damping = structure.loss / omega
        compiled = [as_compiled(hinge.law) for hinge in structure.hinges]
        joints = len(compiled)
        width = max([c.parameters.size for c in compiled], default=0) or 1
        parameters = np.zeros((joints, width))
        for row, c in zip(parameters, compiled, strict=True):
            row[: c.parameters.size] = c.parameters
        counts = np.array([c.n_states for c in compiled], dtype=np.int64)
        self.laws = (np.array([c.address for c in compiled], dtype=np.int64), parameters, counts)
        self.keep_alive = compiled
        self.n_states = max(1, int(counts.max(initial=0)))
        self._whole: dict[bytes, tuple[Array, Array]] = {}

    def inverse(self, direction: Array, h: float) -> Array:
        """Inverse of M + h/2·C + h²/4·K over what moves, zero elsewhere."""
        return _inverse_of_moving(self.mass + h / 2 * self.damping + h * h / 4 * self.stiffness, direction)

    def inverses(self, direction: Array) -> tuple[Array, Array]:
        """Inverses for a whole step and of the mass."""
        key = (direction != 0).tobytes()
        if key not in self._whole:
            self._whole[key] = self.inverse(direction, self.step), _inverse_of_moving(self.mass, direction)
        return self._whole[key]

    def moments(self, direction: Array, force: float, q: Array, v: Array, z: Array) -> Array:
        """Moments and friction bounds of the joints now, shape (joints, 3)."""
        return kernel.holding_moments(
            self.mass, self.inverses(direction)[1], self.damping, self.stiffness, self.laws, direction,
            force * self.load, q, v, z,
        )  # fmt: skip


def _inverse_of_moving(matrix: Array, direction: Array) -> Array:
    moving = np.ones(len(matrix), dtype=bool)
    moving[: direction.size] = direction != 0
    result = np.zeros_like(matrix)
    index = np.ix_(moving, moving)
    result[index] = np.linalg.inv(matrix[index])
    return result


def _side(moment: Array) -> float:
    """Direction that a joint takes whose holding moment, lower and upper bound are given; 0 where it holds."""
    value, low, high = moment
    return 1.0 if value > high else (-1.0 if value < low else 0.0)


class _Crossing:
    """One grid step in which joints change: advances from event to event to the end of the step."""

    def __init__(self, stepper: _Stepper, excitation: Excitation, time: float, state: tuple, direction: Array,
                 work: Array, rate_scale: float):  # fmt: skip
        self.stepper, self.excitation, self.time = stepper, excitation, time
        self.q, self.v, self.z = (x.copy() for x in state)
        self.direction, self.work, self.rate_scale = direction, work, rate_scale
        self.events = 0

    def trial(self, x: float) -> tuple[Array, Array, Array, Array, Array]:
        """State a time x ahead, room of the joints there, and the work done."""
        s = self.stepper
        q1, v1, z1 = np.empty_like(self.q), np.empty_like(self.v), self.z.copy()
        work = np.zeros_like(self.work)
        force = float(self.excitation.mean(self.time, self.time + x)) * s.load
        good = kernel.midpoint_step(
            x, s.inverse(self.direction, x), s.damping, s.stiffness, s.laws, self.direction, force,
            self.q, self.v, self.z, q1, v1, z1, work,
        )  # fmt: skip
        if not good:
            raise _not_converged(self.time, x)
        moments = s.moments(self.direction, float(self.excitation(self.time + x * (1 - 1e-9))), q1, v1, z1)
        return q1, v1, z1, kernel.margins(self.direction, moments, v1, self.rate_scale), work

    def room_now(self) -> Array:
        """Room of the joints before the step."""
        s = self.stepper
        moments = s.moments(self.direction, float(self.excitation(self.time)), self.q, self.v, self.z)
        return kernel.margins(self.direction, moments, self.v, self.rate_scale)

    def decide(self, j: int) -> None:
        """Let joint j, at rest, hold or break away."""
        s = self.stepper
        self.direction[j] = 0.0
        moments = s.moments(self.direction, float(self.excitation(self.time)), self.q, self.v, self.z)
        self.direction[j] = _side(moments[j])
        self.events += 1

    def accept(self, x: float, trial: tuple) -> None:
        """Take a trial step."""
        self.q, self.v, self.z, _, work = trial
        self.work += work
        self.time += x
        # Only a joint without friction gets here against its direction.
        turned = self.v[: self.direction.size] * self.direction < 0
        self.direction[turned] *= -1

    def run(self, h: float) -> None:
        """Advance by h, from event to event."""
        end = self.time + h
        held: set[int] = set()
        for _ in range(200):
            x = end - self.time
            if x <= 1e-9 * h:
                return
            whole = self.trial(x)
            wrong = [j for j in np.flatnonzero(whole[3] < 0).tolist() if j not in held]
            if not wrong:
                self.accept(x, whole)
                return
            now = self.room_now()
            at_once = [j for j in wrong if now[j] <= 0]
            if at_once:
                j = at_once[0]
                before = self.direction[j]
                self.decide(j)
                if before != 0 or self.direction[j] == before:
                    # It broke away and would turn back at once: its moment touches the bound. It rests this step.
                    self.direction[j] = 0.0
                    held.add(j)
                continue

            def room(fraction: float, wrong: list[int] = wrong, x: float = x, now: Array = now) -> float:
                return (
                    float(min(now[wrong]))
                    if fraction == 0
                    else float(min(self.trial(fraction * x)[3][wrong]))
                )

            fraction = float(brentq(room, 0.0, 1.0, xtol=1e-12, rtol=1e-10))
            cut = self.trial(fraction * x)
            j = wrong[int(np.argmin(cut[3][wrong]))]
            if self.direction[j] != 0:
                cut[1][j] = 0.0
            self.accept(fraction * x, cut)
            self._change(j)
        raise SimulationError(
            f"a joint changed between stick and slip over 200 times in one step at t = {self.time:.6g} s; "
            "reduce the step",
            time=self.time,
        )

    def _change(self, j: int) -> None:
        if self.direction[j] != 0:
            self.decide(j)
            return
        s = self.stepper
        moment, low, high = s.moments(
            self.direction, float(self.excitation(self.time)), self.q, self.v, self.z
        )[j]
        # On the bound itself rounding decides; the nearer bound is the one it breaks.
        self.direction[j] = 1.0 if moment > 0.5 * (low + high) else -1.0
        self.events += 1


def _not_converged(time: float, h: float) -> SimulationError:
    return SimulationError(
        f"the joint's moment was not found at t = {time:.6g} s: the step of {h:.3g} s is too large for this law; "
        "reduce the step",
        time=time,
    )


def _check_step(structure: Structure, step: float, duration: float, sample_rate: float) -> int:
    if not (np.isfinite(duration) and duration > 0 and np.isfinite(sample_rate) and sample_rate > 0):
        raise InputError(f"duration {duration!r} s at {sample_rate!r} Hz: positive numbers are wanted")
    if not (np.isfinite(step) and step > 0):
        raise InputError(f"step is {step!r} s; a positive number is wanted")
    first = structure.frequencies(1)[0]
    if step > 1 / (_STEPS_PER_PERIOD * first):
        raise InputError(
            f"step is {step:g} s: too large for the first mode at {first:.3g} Hz; at most "
            f"{1 / (_STEPS_PER_PERIOD * first):.3g} s ({_STEPS_PER_PERIOD} steps per period) is wanted"
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
    initial_angle: Sequence[float] | None = None,
    initial_force: float = 0.0,
) -> Response:
    """Simulate a structure under a force, from rest.

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
    initial_angle : sequence of float, optional
        Joint angles at the start, rad.
    initial_force : float
        Static force at the point that bends the structure at the start and is then released, N. Joints do not move.

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
    stepper = _Stepper(reduced, reduced.point(at).copy(), 1 / (sample_rate * parts))
    record = _Record.begin(stepper, excitation, round(duration * sample_rate) * parts)
    joints = reduced.n_joints
    if initial_angle is not None:
        record.q[0, :joints] = initial_angle
    if initial_force:
        inner = slice(joints, None)
        held = reduced.stiffness[inner, :joints] @ record.q[0, :joints]
        right = initial_force * stepper.load[inner] - held
        record.q[0, inner] = np.linalg.solve(reduced.stiffness[inner, inner], right)
    bounds = np.full((joints, 2), [-np.inf, np.inf])
    if limits:
        for row, hinge in zip(bounds, reduced.hinges, strict=True):
            row[:] = softening_limit(hinge.law)
    events = _advance(stepper, excitation, record, bounds)
    return _collected(stepper, points, parts, record, events)


@dataclass(frozen=True, eq=False)
class _Record:
    """One row per step: force, its value before a jump, its mean over the next step; motion and joints."""

    grid: Array
    force: Array
    before_jump: Array
    mean_force: Array
    q: Array
    v: Array
    z: Array
    moments: Array
    stuck: NDArray[np.bool_]
    work: Array

    @classmethod
    def begin(cls, stepper: _Stepper, excitation: Excitation, count: int) -> _Record:
        joints, n = stepper.structure.n_joints, len(stepper.mass)
        grid = stepper.step * np.arange(count + 1, dtype=np.float64)
        return cls(
            grid, excitation(grid), excitation(grid * (1 - 1e-12)), excitation.mean(grid[:-1], grid[1:]),
            np.zeros((count + 1, n)), np.zeros((count + 1, n)), np.zeros((count + 1, joints, stepper.n_states)),
            np.zeros((count + 1, joints)), np.zeros((count + 1, joints), np.bool_), np.zeros((joints, 2)),
        )  # fmt: skip


def _advance(stepper: _Stepper, excitation: Excitation, record: _Record, bounds: Array) -> int:
    """Fill the record from its first row on; return the number of events."""
    grid, q, v, z = record.grid, record.q, record.v, record.z
    hinges, joints, last = stepper.structure.hinges, stepper.structure.n_joints, len(grid) - 1
    direction = np.zeros(joints)
    start = stepper.moments(direction, record.force[0], q[0], v[0], z[0])
    direction[:] = [_side(row) for row in start]
    record.moments[0] = np.clip(start[:, 0], start[:, 1], start[:, 2])
    record.stuck[0] = direction == 0
    reached, events = 0, 0
    while reached < last:
        reached, reason, j = kernel.march(
            reached, last, stepper.step, *stepper.inverses(direction), stepper.mass, stepper.damping,
            stepper.stiffness, stepper.laws, direction, bounds, stepper.load, record.mean_force, record.before_jump,
            q, v, z, record.moments, record.stuck, record.work,
        )  # fmt: skip
        if reason == kernel.NOT_CONVERGED:
            raise _not_converged(grid[reached], stepper.step)
        if reason == kernel.PAST_LIMIT:
            raise _past_limit(hinges[j].name, bounds[j], grid[reached])
        if reason == kernel.CHANGE:
            scale = max(1e-12, float(np.abs(v[: reached + 1, :joints]).max(initial=0.0)))
            state = q[reached], v[reached], z[reached]
            crossing = _Crossing(stepper, excitation, grid[reached], state, direction, record.work, scale)
            crossing.run(stepper.step)
            reached += 1
            q[reached], v[reached], z[reached] = crossing.q, crossing.v, crossing.z
            now = stepper.moments(direction, record.before_jump[reached], q[reached], v[reached], z[reached])
            record.moments[reached], record.stuck[reached] = now[:, 0], direction == 0
            events += crossing.events
            angles = q[reached, :joints]
            for k in np.flatnonzero((angles < bounds[:, 0]) | (angles > bounds[:, 1])):
                raise _past_limit(hinges[k].name, bounds[k], grid[reached])
    return events


def _past_limit(name: str, bounds: Array, time: float) -> SimulationError:
    return SimulationError(
        f"joint {name!r} left its angle range ({bounds[0]:.4g} to {bounds[1]:.4g} rad) at t = {time:.6g} s: past the "
        "softening limit its tangent stiffness is negative; lower the force, or pass limits=None to follow it",
        time=float(time),
    )


def _collected(
    stepper: _Stepper, points: Sequence[str], parts: int, record: _Record, events: int
) -> Response:
    structure, joints = stepper.structure, stepper.structure.n_joints
    middle = (record.v[1:] + record.v[:-1]) / 2
    lost = float(np.einsum("ti,ij,tj->", middle, stepper.damping, middle, optimize=True)) * stepper.step
    keep = slice(None, None, parts)
    q, v = record.q[keep], record.v[keep]
    energy = 0.5 * (
        np.einsum("ti,ij,tj->t", v, structure.mass, v, optimize=True)
        + np.einsum("ti,ij,tj->t", q, structure.stiffness, q, optimize=True)
    )
    for j, hinge in enumerate(structure.hinges):
        energy += _elastic_energy(hinge.law, q[:, j])
    return Response(
        time=record.grid[keep], displacement={name: q @ structure.point(name) for name in points},
        force=record.force[keep], joints=tuple(hinge.name for hinge in structure.hinges),
        angle=q[:, :joints].T, rate=v[:, :joints].T, moment=record.moments[keep].T, stuck=record.stuck[keep].T,
        energy=energy, joint_dissipation=record.work[:, 1], beam_dissipation=lost, step=stepper.step, events=events,
    )  # fmt: skip


def _elastic_energy(law: Any, angle: Array) -> Array:
    """Energy stored in the memoryless elastic part of a law.

    Its moment at rest, in the middle of the friction interval, integrated from zero by Gauss' rule of four points.
    """
    nodes, weights = np.polynomial.legendre.leggauss(4)
    fractions = (nodes + 1) / 2
    points = np.outer(fractions, angle)
    zero = np.zeros(points.size)
    state = np.zeros((law.n_states, points.size))
    values = law.moment(points.ravel(), zero, zero, state).reshape(points.shape)
    return angle * (weights / 2 @ values)
