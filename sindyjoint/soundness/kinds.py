"""The ids that findings have: what ``--accept`` takes."""

from __future__ import annotations

KINDS = (
    "ac_coupling",
    "angle_offset",
    "channel_delay",
    "channel_slip",
    "channels_disagree",
    "clock_drift",
    "coarse_quantisation",
    "coverage",
    "dead_start",
    "dead_tail",
    "drift",
    "dropouts",
    "duplicate_channel",
    "duplicate_run",
    "excess_noise",
    "few_samples_per_period",
    "frozen_channel",
    "frozen_segment",
    "gain_changes",
    "gain_differs",
    "gives_off_energy",
    "implausible_size",
    "level_changes",
    "lost_samples",
    "low_pass",
    "mains_hum",
    "no_signal",
    "repeated_block",
    "reversed_sign",
    "run_differs",
    "saturation",
    "scaled_copy",
    "sensors_disagree",
    "sign_flips",
    "spikes",
    "structure_differs",
    "swapped_channels",
    "unit_mismatch",
    "wrong_frequency",
    "zero_jumps",
)
DELAY = "channel_delay"
#: What shifts one channel against the other in time: damping and friction change places with stiffness.
PHASE = (DELAY, "ac_coupling", "channel_slip", "clock_drift", "low_pass")
