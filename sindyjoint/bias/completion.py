"""Force states completed by the harmonics below the noise, from a simulation of the model.

When a joint begins to stick its acceleration jumps. The angle's harmonics then fall so slowly that those about and
below the noise still matter to the acceleration, and with a heavy joint to the moment: I·θ̈ of a noisy, truncated
series rings, and terms that the joint lacks seem to be needed. The model's motion under the measured drive has these
harmonics. Strong ones stay as measured; what is not known to a tenth is the model's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.bias.periodic import PeriodicReplicate
from sindyjoint.bias.policy import POLICY
from sindyjoint.bias.replicates import make_replicates
from sindyjoint.mechanics.laws import Law
from sindyjoint.numeric import Array
from sindyjoint.record import Run
from sindyjoint.states import ForceStates, Harmonics
from sindyjoint.states.harmonics import HarmonicBasis


def completed_states(
    law: Law | list[Law], runs: Sequence[Run], states: Sequence[ForceStates]
) -> tuple[ForceStates, ...] | None:
    """Return states whose weak and missing harmonics are the law's; None where they matter little to the moment.

    Parameters
    ----------
    law : Law or list of Law
        Of all runs, or of each; of one inertia.
    runs : sequence of Run
    states : sequence of ForceStates
        Of the same runs, as measured. Only periodic runs whose drive is known change.

    Raises
    ------
    SimulationError
        If the law has no finite moment along a measured motion.
    """
    whole = sum(float(np.sum(s.moment[s.moving] ** 2)) for s in states)
    inertia = (law[0] if isinstance(law, list) else law).inertia
    inertial = sum(float(np.sum((inertia * s.acceleration[s.moving]) ** 2)) for s in states)
    if inertial < (2 * POLICY.completion_matters) ** 2 * whole:
        # Weak harmonics are no more than half of the acceleration: there is no need to simulate anything.
        return None
    replicates = make_replicates(law, runs, states)
    changed, exchanged = [], 0.0
    for state, replicate in zip(states, replicates, strict=True):
        moving = state.moving
        better = state
        if (
            isinstance(replicate, PeriodicReplicate)
            and replicate.driven == "moment"
            and len(state.series) == 1
        ):
            better = _complete_run(state, replicate)
            exchanged += float(np.sum((inertia * (better.acceleration - state.acceleration)[moving]) ** 2))
        changed.append(better)
    return None if exchanged < POLICY.completion_matters**2 * whole else tuple(changed)


def _complete_run(state: ForceStates, simulated: PeriodicReplicate) -> ForceStates:
    """Return a run's states of its strong harmonics and the others of its synthetic replicate."""
    frequency = simulated.angular / (2 * np.pi)
    time = state.time - state.time[0]
    kept = state.series[0]
    basis = HarmonicBasis.build(time, frequency, kept.orders)
    _, a, b = basis.fit(state.angle)
    strong = np.hypot(a, b) > POLICY.harmonic_as_measured * kept.standard_error
    strong[0] = True
    measured = Harmonics(kept.orders[strong], kept.standard_error[strong])
    n = simulated.moment.size
    others = [
        np.interp(frequency * time * n, np.arange(n), column, period=n)
        for column in simulated.beyond((measured,)).T
    ]

    def motion(angle: Array, rows: slice) -> list[Array]:
        part = basis.rows(rows)
        mean, a, b = part.fit(angle[rows])
        part, a, b = part.take(strong), a[strong], b[strong]
        strongest = (part.series(mean, a, b), part.derivative(a, b), part.second_derivative(a, b))
        return [signal + other[rows] for signal, other in zip(strongest, others, strict=True)]

    angle, rate, acceleration = motion(state.angle, slice(None))
    replicate = state.replicate
    if replicate is not None:
        edges = np.flatnonzero(np.diff(state.block, prepend=-1, append=-1))
        parts = [motion(replicate[0], slice(*ends)) for ends in zip(edges[:-1], edges[1:], strict=True)]
        first, second, third = (np.concatenate(column) for column in zip(*parts, strict=True))
        replicate = (first, second, third)
    noise = replace(
        state.noise,
        rate=measured.derivative_noise(frequency, 1),
        acceleration=measured.derivative_noise(frequency, 2),
    )
    return replace(
        state,
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        replicate=replicate,
        noise=noise,
        series=(measured,),
        completed=True,
    )
