"""Candidate effects, read from catalogues: their columns, internal states, and what they change in a structure."""
