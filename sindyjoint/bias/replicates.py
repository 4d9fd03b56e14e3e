"""Synthetic replicates of a campaign's runs, each made in the way in which the run's force states were made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from sindyjoint.bias.broadband import make_broadband_replicate
from sindyjoint.bias.periodic import Spectrum, estimate_exciter_inertia, make_periodic_replicate
from sindyjoint.mechanics.laws import Law
from sindyjoint.numeric import Array
from sindyjoint.record import Run
from sindyjoint.states import ForceStates


class Replicate(Protocol):
    """A run of a known law, ready for the processing pipeline."""

    @property
    def driven(self) -> str:
        """What was prescribed: "moment" or "angle"."""

    @property
    def weight(self) -> float:
        """Samples of the run per row of the replicate."""

    def noise(self, rng: np.random.Generator) -> Any:
        """Draw what the noise of the motion's channels adds to the force states."""

    def rows(self, noise: Any = None, sign: float = 1.0) -> tuple[Array, Array]:
        """Return moving (θ, θ̇, θ̈), shape (m, 3), and the moment, shape (m,), under noise times a sign."""


def make_replicates(
    law: Law | list[Law], runs: Sequence[Run], states: Sequence[ForceStates]
) -> list[Replicate]:
    """Return a synthetic replicate for each run.

    Parameters
    ----------
    law : Law or list of Law
        Of all runs, or of each.
    runs : sequence of Run
    states : sequence of ForceStates
        Of the same runs.

    Raises
    ------
    SimulationError
        If the law has no finite moment along a measured motion.
    """
    laws = law if isinstance(law, list) else [law] * len(states)
    spectra = {s.run: Spectrum.of(run, s) for run, s in zip(runs, states, strict=True) if s.series}
    periodic = [s for s in states if s.series]
    exciter_inertia = (
        estimate_exciter_inertia([spectra[s.run] for s in periodic], periodic) if periodic else 0.0
    )
    return [
        make_periodic_replicate(own, state, spectra[state.run], exciter_inertia)
        if state.series
        else make_broadband_replicate(own, run, state)
        for own, run, state in zip(laws, runs, states, strict=True)
    ]
