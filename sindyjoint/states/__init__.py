"""From measured moment and angle to force states (θ, θ̇, θ̈, M, moving)."""

from sindyjoint.states.build import campaign_states, force_states
from sindyjoint.states.record import ForceStates, NoiseFloor

__all__ = ["ForceStates", "NoiseFloor", "campaign_states", "force_states"]
