"""A manifest from files alone: what their columns are, in which units, how fast and how far each run went."""
