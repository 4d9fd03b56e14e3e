"""Libraries and optimizers of pysindy in the place of catalogues and methods: the rest stays the same."""

import numpy as np
import pysindy
import pytest

from sindyjoint import JointRegressor, discover
from sindyjoint.errors import InputError


def test_a_polynomial_library_finds_the_smooth_part_of_a_law(rows):
    # Without friction among the candidates the rest of the law is found, and the friction is not invented.
    X = rows["X"]
    noise = np.random.default_rng(1).normal(size=len(X))
    moment = 6066 * X[:, 0] - 2.684e9 * X[:, 0] ** 3 + 48.13 * X[:, 1] + 0.01 * noise
    found = JointRegressor(pysindy.PolynomialLibrary(degree=3)).fit(X, moment, groups=rows["groups"])
    assert found.selected_ == ("linear_stiffness", "linear_damping", "cubic_stiffness")
    assert found.model_["linear_stiffness"].coefficient == pytest.approx(6066, rel=1e-3)


@pytest.mark.parametrize("method", ["pysindy:FROLS", pysindy.FROLS(alpha=0.0)])
def test_an_optimizer_of_pysindy_proposes_and_the_evidence_is_ours(inter_panel, method):
    found = discover(inter_panel, method=method, correct=False)
    assert "coulomb_friction" in found.model and found.model["linear_stiffness"].standard_error > 0
    assert found.verdict.verdict in {"confirmed", "undecided"}


def test_an_optimizer_is_not_touched(rows):
    given = pysindy.STLSQ(threshold=0.05, alpha=0.0)
    found = JointRegressor("paper", method=given).fit(rows["X"], rows["y"], groups=rows["groups"])
    assert not hasattr(given, "coef_") and "linear_stiffness" in found.selected_


def test_an_optimizer_that_cannot_fit_is_one_line(rows):
    broken = pysindy.STLSQ(initial_guess=np.ones((1, 3)))
    with pytest.raises(InputError, match="pysindy:STLSQ cannot fit these candidates: initial_guess shape"):
        JointRegressor("paper", method=broken).fit(rows["X"], rows["y"])
