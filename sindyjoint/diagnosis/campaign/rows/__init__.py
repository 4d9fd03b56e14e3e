"""A run as rows: moments, or what they change of a free motion, in units of independent noise."""
