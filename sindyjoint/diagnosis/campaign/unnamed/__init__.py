"""Laws that no catalogue names: what a surface, a memory or a run of its own would explain of a gap."""
