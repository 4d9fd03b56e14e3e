"""What makes motion: joint laws, excitations, exact stick–slip simulation, virtual tests and structures.

Nothing here knows how laws are discovered; a recovered law is simulated through the protocol of
:class:`sindyjoint.mechanics.laws.Law`.
"""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "beam": "Beam rectangular_section",
        "excitation": "Actuator harmonic pulse sampled tones",
        "laws": "INTER_PANEL PANEL_ROOT FormulaLaw FunctionLaw LawWithNumbers PaperLaw SumLaw",
        "rig_file": "RigFile rig_path shipped_rigs",
        "rig_test": "RigRun RigTest Sensor UncertainNumber uncertain_numbers",
        "rig_test_file": "load_rig_structure load_rig_test",
        "rigs": "MeasuredResponse load_rig",
        "segments": "simulate_segments",
        "sensors": "Channel delayed",
        "stickslip": "simulate simulate_many slip_direction transfer_moment",
        "structure": "Hinge LumpedMass Structure assemble craig_bampton",
        "transient": "respond",
        "virtual": "BEAM_INERTIA virtual_campaign",
        "virtual_rig": "presliding_law virtual_pulse_test with_laws with_loss_factor",
    },
)
