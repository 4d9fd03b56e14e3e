"""Seeds of a test: the first holds in every run what the others hold, under ``slow``, of more noise."""

import pytest


def seeds(first, *others):
    """Return the mark of a test that has an argument ``seed``."""
    return pytest.mark.parametrize("seed", [first, *slow(*others)])


def slow(*cases):
    """Return further cases of a test, under ``slow``: numbers of one, or several of each in a tuple."""
    return [pytest.param(*(c if isinstance(c, tuple) else (c,)), marks=pytest.mark.slow) for c in cases]
