"""The error model of a test: what its repeats, its channels and its declarations say of noise, for every verb alike."""
