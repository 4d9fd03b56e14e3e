"""Seeds of a test: the first holds in every run what the others hold, under ``slow``, of more noise."""

import pytest


def seeds(first, *others):
    """Return the mark of a test that has an argument ``seed``."""
    further = (pytest.param(seed, marks=pytest.mark.slow) for seed in others)
    return pytest.mark.parametrize("seed", [first, *further])
