"""Steps of a structure with joints: whole steps in compiled code, and the instants at which joints change."""

import math
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

import sindyjoint.mechanics.transient_kernel as kernel
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.structure import Structure
from sindyjoint.numeric import Array


class Stepper:
    """The matrices of a reduced structure and the laws of its joints, for steps in compiled code."""

    def __init__(self, structure: Structure, load: Array, step: float):
        self.structure, self.load, self.step = structure, load, step
        self.mass, self.stiffness, self.damping = structure.mass, structure.stiffness, structure.damping
        compiled = [hinge.law.compiled() for hinge in structure.hinges]
        joints = len(compiled)
        parameters = np.zeros((joints, max([c.numbers.size for c in compiled], default=0) or 1))
        for row, c in zip(parameters, compiled, strict=True):
            row[: c.numbers.size] = c.numbers
        counts = np.array([c.n_states for c in compiled], dtype=np.int64)
        self.laws = (np.array([c.address for c in compiled], dtype=np.int64), parameters, counts)
        self.keep_alive = compiled
        self.n_states = max(1, int(counts.max(initial=0)))
        self.unbounded = np.tile([-np.inf, np.inf], (joints, 1))
        self.room = np.zeros(kernel.room_for(len(self.mass), joints, self.n_states))
        # With room for the inverses of a step.
        spare = np.zeros_like(self.mass)
        self.matrices = np.stack([spare, spare, self.mass, self.damping, self.stiffness])

    def march(self, first: int, last: int, direction: Array, limits: Array, forces: tuple[Array, Array],
              rows: tuple[Array, Array, Array, Array, NDArray[np.bool_]], work: Array,
              h: float | None = None) -> tuple[int, int, int]:  # fmt: skip
        """Take whole steps; see :func:`transient_kernel.march`. `rows` are q, v, z, moments and stuck."""
        return kernel.march(
            first, last, h or self.step, self.matrices, self.load, self.laws, direction, limits, forces,
            rows[:3], rows[3], rows[4], work, self.room,
        )  # fmt: skip

    def moments(self, direction: Array, force: float, q: Array, v: Array, z: Array) -> Array:
        """Moments and friction bounds of the joints now, shape (joints, 3)."""
        forces, joints = np.array([force]), direction.size
        answer, stuck = np.empty((1, joints, 3)), np.empty((1, joints), np.bool_)
        rows = q[None], v[None], z[None], answer, stuck
        self.march(0, 0, direction, self.unbounded, (forces, forces), rows, np.empty((2, joints, 2)))
        return answer[0]


def side_of(moment: Array) -> float:
    """Direction that a joint takes whose holding moment, lower and upper bound are given; 0 where it holds."""
    value, low, high = moment
    return 1.0 if value > high else (-1.0 if value < low else 0.0)


def margins(direction: Array, moments: Array, v1: Array, rate_scale: float) -> Array:
    """How far each joint is from changing: its rate along its direction, or its moment's room in the interval."""
    answer = np.empty(direction.size)
    # Numbers, not arrays: for one joint or two, each call of NumPy would take longer than all of this.
    rows = zip(direction.tolist(), moments.tolist(), v1.tolist(), strict=False)
    for j, (side, (held, low, high), rate) in enumerate(rows):
        width = high - low
        if side == 0:
            answer[j] = min(high - held, held - low) / max(width / 2, 1e-300)
        elif width <= kernel.FRICTIONLESS * (abs(low) + abs(high)):
            answer[j] = math.inf
        else:
            answer[j] = rate * side / rate_scale
    return answer


class Crossing:
    """One grid step in which joints change: advances from event to event to the end of the step."""

    def __init__(self, stepper: Stepper, excitation: Excitation, time: float, state: tuple[Any, ...], direction: Array,
                 work: Array, rate_scale: float):  # fmt: skip
        self.stepper, self.excitation, self.time = stepper, excitation, time
        self.q, self.v, self.z = (x.copy() for x in state)
        self.direction, self.work, self.rate_scale = direction, work, rate_scale
        self.events = 0
        # Two samples each of q, v, z, moments and sticking: now, and where a trial ends.
        joints = direction.size
        q, v, z = (np.zeros((2, *x.shape)) for x in state)
        self.rows = q, v, z, np.empty((2, joints, 3)), np.empty((2, joints), np.bool_)

    def trial(self, x: float) -> tuple[Array, Array, Array, Array, Array]:
        """State a time x ahead, room of the joints there, and the work done; the next trial overwrites the state."""
        mean = self.excitation.mean(self.time, self.time + x)
        now = self.excitation(self.time + x * (1 - 1e-9))
        forces = np.array([mean, mean]), np.array([now, now])
        q, v, z, moments, _ = self.rows
        q[0], v[0], z[0] = self.q, self.v, self.z
        work, s = np.zeros((2, self.direction.size, 2)), self.stepper
        _, reason, _ = s.march(0, 1, self.direction.copy(), s.unbounded, forces, self.rows, work, x)
        if reason == kernel.NOT_CONVERGED:
            raise not_converged(self.time, x)
        return q[1], v[1], z[1], margins(self.direction, moments[1], v[1], self.rate_scale), work[1]

    def _moments(self) -> Array:
        force = float(self.excitation(self.time))
        return self.stepper.moments(self.direction, force, self.q, self.v, self.z)

    def decide(self, j: int) -> None:
        """Let joint j, at standstill, hold or break away."""
        self.direction[j] = 0.0
        self.direction[j] = side_of(self._moments()[j])
        self.events += 1

    def accept(self, x: float, trial: tuple[Any, ...]) -> None:
        """Take a trial step."""
        *state, _, work = trial
        self.q, self.v, self.z = (x.copy() for x in state)
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
            now = margins(self.direction, self._moments(), self.v, self.rate_scale)
            at_once = [j for j in wrong if now[j] <= 0]
            if at_once:
                j = at_once[0]
                before = self.direction[j]
                self.decide(j)
                if before != 0 or self.direction[j] == before:
                    # It broke away and would turn back at once: its moment touches the bound. It sticks in this step.
                    self.direction[j] = 0.0
                    held.add(j)
                continue

            fraction, cut = self._first_change(x, wrong, now, whole[3])
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

    def _first_change(
        self, x: float, wrong: list[int], now: Array, then: Array
    ) -> tuple[float, tuple[Any, ...]]:
        """Return at which share of a time x the first of some joints changes, and the trial step up to there.

        `now` and `then` are the rooms of all joints at both ends.
        """
        ends = {0.0: float(min(now[wrong])), 1.0: float(min(then[wrong]))}
        last: tuple[float, tuple[Any, ...]] = -1.0, ()

        def room(share: float) -> float:
            nonlocal last
            if share in ends:
                return ends[share]
            last = share, self.trial(share * x)
            return float(min(last[1][3][wrong]))

        share = float(scipy.optimize.brentq(room, 0.0, 1.0, xtol=1e-12, rtol=1e-10))
        return share, last[1] if last[0] == share else self.trial(share * x)

    def _change(self, j: int) -> None:
        if self.direction[j] != 0:
            self.decide(j)
            return
        moment, low, high = self._moments()[j]
        # On the bound itself rounding decides; the nearer bound is the one it breaks.
        self.direction[j] = 1.0 if moment > 0.5 * (low + high) else -1.0
        self.events += 1


def not_converged(time: float, h: float) -> SimulationError:
    """Say that Newton found no moment in a step, what that means and what to do."""
    return SimulationError(
        f"the joint's moment was not found at t = {time:.6g} s: the step of {h:.3g} s is too large for this law; "
        "reduce the step",
        time=time,
    )
