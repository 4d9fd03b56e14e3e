"""Models to export, made from catalogue terms with given coefficients: no fit is needed to write a deck."""

import numpy as np
import pytest

from tests.export.made import ANGLE, RATE, model_of


@pytest.fixture(scope="session")
def make_model():
    """Return a function from coefficients by term id to a model."""
    return model_of


@pytest.fixture(scope="session")
def paper_model(make_model):
    """The paper's five-term law as a model."""
    return make_model()


@pytest.fixture(scope="session")
def states():
    """Random states inside the tested range, seed 1, rates kept off zero."""
    rng = np.random.default_rng(1)
    rate = rng.uniform(0.05, 1, 400) * rng.choice([-1, 1], 400) * RATE
    return rng.uniform(-ANGLE, ANGLE, 400), rate
