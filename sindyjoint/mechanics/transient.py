"""Motion of a structure with joints after a pulse.

Between events, steps of fixed length; where a joint sticks or breaks away, the step is cut at that
instant. The implicit midpoint rule (the average-acceleration rule for linear parts) loses no energy.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import sindyjoint.mechanics.crossing as crossing
from sindyjoint.clock import STEP_SAMPLES, spend
from sindyjoint.errors import SimulationError, refuse
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.structure import Structure, craig_bampton
from sindyjoint.numeric import Array, Booleans

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
    stuck: Booleans
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
    motion = _Motion(
        reduced, at, excitation, 1 / (sample_rate * parts), round(duration * sample_rate) * parts
    )
    events = motion.fill(limits is not None)
    return _collect_response(motion, points, parts, events)


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
    motion = _Motion(reduced, at, excitation, 1 / sample_rate, round(duration * sample_rate))
    if initial is not None:
        motion.q[0], motion.v[0], motion.z[0] = initial
    motion.fill()
    return motion.q, motion.v, motion.z


class _Motion:
    """A reduced structure under a force, one row per step: the force, motion and joints.

    `moments` holds what each joint transfers and the bounds of its friction, `work` that of all steps and of the last.
    """

    def __init__(self, structure: Structure, at: str, excitation: Excitation, step: float, count: int):
        self.structure, self.step, self.excitation = structure, step, excitation
        self.load = structure.point(at).copy()
        self.compiled = [hinge.law.compiled() for hinge in structure.hinges]
        joints, n = structure.n_joints, len(structure.mass)
        states = max(1, *(law.n_states for law in self.compiled), 1)
        self.grid = step * np.arange(count + 1, dtype=np.float64)
        self.q, self.v = np.zeros((2, count + 1, n))
        self.z = np.zeros((count + 1, joints, states))
        self.moments, self.stuck = np.zeros((count + 1, joints, 3)), np.zeros((count + 1, joints), np.bool_)
        self.work = np.zeros((2, joints, 2))

    def fill(self, limited: bool = True) -> int:
        """Fill the rows from the first one on; return how often joints changed."""
        hinges, structure, grid = self.structure.hinges, self.structure, self.grid
        ends = [hinge.law.softening_limit if limited else (-np.inf, np.inf) for hinge in hinges]
        bounds = np.array(ends, dtype=np.float64).reshape(-1, 2)
        parameters = np.zeros((len(hinges), max([law.numbers.size for law in self.compiled], default=0) or 1))
        for row, law in zip(parameters, self.compiled, strict=True):
            row[: law.numbers.size] = law.numbers
        addresses, counts = (
            np.array([getattr(law, name) for law in self.compiled], dtype=np.int64)
            for name in ("address", "n_states")
        )
        mean, before_jump = self.excitation.mean(grid[:-1], grid[1:]), self.excitation(grid * (1 - 1e-12))
        # With room for the inverses of a step.
        spare = np.zeros_like(structure.mass)
        matrices = np.stack([spare, spare, structure.mass, structure.damping, structure.stiffness])
        room = np.zeros(crossing.room_for(len(self.load), len(hinges), self.z.shape[2]))
        spend(STEP_SAMPLES * (len(grid) - 1) * self.q.shape[1])
        reached, reason, j, changes = crossing.march(
            self.step, matrices, self.load, (addresses, parameters, counts), bounds,
            self.excitation.integrated, (mean, before_jump), (self.q, self.v, self.z), self.moments, self.stuck,
            self.work, room,
        )  # fmt: skip
        if reason != crossing.END:
            time, (low, high) = float(grid[reached]), bounds[j]
            texts = {
                crossing.PAST_LIMIT: (
                    f"joint {hinges[j].name!r} left its angle range ({low:.4g} to {high:.4g} rad) at t = {time:.6g} s: "
                    "past the softening limit its tangent stiffness is negative; lower the force, or pass limits=None "
                    "to follow it"
                ),
                crossing.NOT_CONVERGED: (
                    f"the joint's moment was not found at t = {time:.6g} s: the step of {self.step:.3g} s is too large "
                    "for this law; reduce the step"
                ),
                crossing.RESTLESS: (
                    f"a joint changed between stick and slip over {crossing.CHANGES} times in one step at "
                    f"t = {time:.6g} s; reduce the step"
                ),
            }
            raise SimulationError(texts[reason], time=time)
        return int(changes)


def _collect_response(record: _Motion, points: Sequence[str], parts: int, events: int) -> Response:
    structure, joints = record.structure, record.structure.n_joints
    middle = (record.v[1:] + record.v[:-1]) / 2
    lost = float(np.sum((middle @ structure.damping) * middle)) * record.step
    keep = slice(None, None, parts)
    q, v = record.q[keep], record.v[keep]
    stored = [_integrate_elastic_energy(hinge.law, q[:, j]) for j, hinge in enumerate(structure.hinges)]
    energy = 0.5 * (
        np.einsum("ti,ti->t", v @ structure.mass, v) + np.einsum("ti,ti->t", q @ structure.stiffness, q)
    )
    energy += sum(stored)
    rows = {name: structure.point(name) for name in points}
    return Response(
        time=record.grid[keep], displacement={name: q @ row for name, row in rows.items()},
        force=record.excitation(record.grid)[keep], joints=tuple(hinge.name for hinge in structure.hinges),
        angle=q[:, :joints].T, rate=v[:, :joints].T, moment=record.moments[keep, :, 0].T, stuck=record.stuck[keep].T,
        energy=energy, joint_dissipation=record.work[0, :, 1], beam_dissipation=lost, step=record.step, events=events,
        velocity={name: v @ row for name, row in rows.items()},
    )  # fmt: skip


def _integrate_elastic_energy(law: Any, angle: Array) -> Array:
    """Energy stored in the memoryless elastic part of a law.

    Its moment at standstill, in the middle of the friction interval, integrated from zero by Gauss' rule of four
    points.
    """
    nodes, weights = np.polynomial.legendre.leggauss(4)
    points = np.outer((nodes + 1) / 2, angle)
    return angle * (weights / 2 @ law.moment(points, 0.0, 0.0))
