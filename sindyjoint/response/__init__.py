"""A model against a measured response: its law, one simulated run, output-error refinement, verification."""
