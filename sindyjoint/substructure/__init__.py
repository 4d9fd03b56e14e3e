"""The states of joints inside a structure, from the sensors of the structure."""
