"""A model against a measured response: its law, one simulated run, output-error refinement, verification."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "compared": "corrected law_of_test",
        "drive": "prescribed",
        "laws": (
            "Instant LawInRun Part draw_models elastic_moment held_laws law_in_run law_terms model_law "
            "parts_of sum_law with_coefficients"
        ),
        "oscillations": "Oscillation compare_oscillations hilbert_envelope oscillation",
        "output_error": "OutputError",
        "output_error_runs": "Parameter term_columns",
        "refinement": "refine spread_starts undetermined_directions",
        "run": "along_motion measured_drive rest_of simulate_run",
        "verification": "Band RunVerification Verification",
        "verify_campaign": "cycle_energy",
    },
)
