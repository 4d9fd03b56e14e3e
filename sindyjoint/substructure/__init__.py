"""Joint states from the sensors of a structure, and response curves by harmonic balance."""
