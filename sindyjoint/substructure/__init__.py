"""Joint states from the sensors of a structure, and response curves by harmonic balance."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "forced": "frequency_response",
        "harmonic_balance": "Balance",
        "joint_curves": "MEASURES loop_measures model_curve",
        "modes": "mode_over_amplitude slip_amplitudes",
        "spectra": "steady_states",
        "recovery": "held_spectra held_warnings recover update_structure with_numbers",
        "simulated.segment_parts": "slow_lines",
        "simulated.segments": "SegmentedRun",
        "simulated.steady": "coefficients complex_amplitudes steady",
        "states": "joint_states joints_seen worth_of_sensors",
        "transfer": "expected_jumps open_joints static_moments",
        "unseen": "find_slow",
    },
)
