"""A model beside a measured response: its law, one simulated run, output-error refinement, verification."""
