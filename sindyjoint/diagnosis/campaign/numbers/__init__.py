"""The numbers of a repaired model: whose they are, how sure they are, and what processing does to them."""
