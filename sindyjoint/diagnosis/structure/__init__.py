"""Diagnosis of a structure under a pulse: effects fitted on the simulated response."""
