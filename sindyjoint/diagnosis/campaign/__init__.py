"""Diagnosis of a campaign: runs as rows of independent unit noise, effects fitted to them, gaps, advice."""
