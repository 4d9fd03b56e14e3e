"""From measured moment and angle to force states (θ, θ̇, θ̈, M, moving)."""

from sindyjoint.states.build import campaign_states, force_states, one_after_another, states_of
from sindyjoint.states.floor import transfer_noise
from sindyjoint.states.record import ForceStates, Harmonics, NoiseFloor, RegressionRows, regression_rows

__all__ = [
    "ForceStates",
    "Harmonics",
    "NoiseFloor",
    "RegressionRows",
    "campaign_states",
    "force_states",
    "one_after_another",
    "regression_rows",
    "states_of",
    "transfer_noise",
]
