"""Twins of a campaign's runs, each made in the way in which the run's force states were made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sindyjoint.bias.broadband import broadband_twin
from sindyjoint.bias.periodic import Spectrum, inertia_in_front, periodic_twin
from sindyjoint.mechanics.laws import Law
from sindyjoint.record import Run
from sindyjoint.states import ForceStates

Array = NDArray[np.float64]


class Twin(Protocol):
    """A run of a known law, ready to be seen through the chain."""

    @property
    def driven(self) -> str:
        """What was prescribed: "moment" or "angle"."""

    @property
    def weight(self) -> float:
        """Samples of the run for each row of the twin."""

    def noise(self, rng: np.random.Generator) -> Any:
        """Draw what the noise of the motion's channels adds to the force states."""

    def rows(self, noise: Any = None, sign: float = 1.0) -> tuple[Array, Array]:
        """Return moving (θ, θ̇, θ̈), shape (m, 3), and the moment, shape (m,), under noise times a sign."""


def make_twins(law: Law, runs: Sequence[Run], states: Sequence[ForceStates]) -> list[Twin]:
    """Return a twin for each run.

    Parameters
    ----------
    law : Law
    runs : sequence of Run
    states : sequence of ForceStates
        Of the same runs.

    Raises
    ------
    SimulationError
        If the law has no finite moment along a measured motion.
    """
    spectra = {s.run: Spectrum.of(run, s) for run, s in zip(runs, states, strict=True) if s.series}
    periodic = [s for s in states if s.series]
    front = inertia_in_front([spectra[s.run] for s in periodic], periodic) if periodic else 0.0
    return [
        periodic_twin(law, state, spectra[state.run], front)
        if state.series
        else broadband_twin(law, run, state)
        for run, state in zip(runs, states, strict=True)
    ]
