"""Campaigns that several tests of the evidence share, simulated once."""

import numpy as np
import pytest

from sindyjoint import discover, simulate
from sindyjoint.discovery.factors import Factor
from sindyjoint.states import regression_rows

TRUTH = np.array([6.066e3, -1.927e5, -2.684e9, 48.13, 1.867])
PLAN = dict(frequencies=[3, 4, 5, 6], levels=[0.9, 0.6, 0.35], duration=4.0, noise=0.01, random_state=0)


@pytest.fixture(scope="session")
def inter_panel():
    """Return a virtual test of the paper's inter-panel joint at 1 % noise."""
    return simulate(**PLAN)


@pytest.fixture(scope="session")
def found(inter_panel):
    """Return its discovery."""
    return discover(inter_panel)


@pytest.fixture(scope="session")
def evidence(found):
    """Return its factors."""
    return found.regressor.evidence_


@pytest.fixture(scope="session")
def rows(inter_panel, found):
    """Return its regression rows as arguments of fit."""
    return regression_rows(found.states, inter_panel.joint.inertia).fit_arguments()


def random_factor(seed, n=200, p=9, noise=5.0):
    """Return a factor of correlated columns with three true ones, and the columns and target behind it."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(n, p)) @ rng.normal(size=(p, p))
    target = columns[:, :3] @ [1.0, 2.0, 3.0] + noise * rng.normal(size=n)
    return Factor.of(columns, target), columns, target


@pytest.fixture
def make_factor():
    """Return :func:`random_factor`."""
    return random_factor
