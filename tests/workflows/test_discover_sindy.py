"""What a discovery is to a user of pysindy."""

import numpy as np
import pysindy
import pytest

from sindyjoint import discover, simulate
from sindyjoint.errors import InputError


@pytest.fixture(scope="module")
def found():
    return discover(
        simulate(
            "inter-panel", frequencies=[3, 4, 5], levels=[0.9, 0.5], duration=4.0, noise=0.01, random_state=0
        )
    )


def test_it_is_a_fitted_sindy_in_physical_units(found):
    sindy = found.sindy
    assert isinstance(sindy, pysindy.SINDy)
    values = dict(zip(sindy.get_feature_names(), sindy.coefficients()[0], strict=True))
    assert {name for name, value in values.items() if value} == set(found.model.ids)
    assert all(values[term.id] == term.coefficient for term in found.model.terms)


def test_it_predicts_and_scores_the_moment(found):
    state = found.states[0]
    keep = state.moving
    x = np.column_stack([state.angle, state.rate])[keep]
    moment = state.transfer_moment(found.model.inertia)[keep]
    np.testing.assert_allclose(found.sindy.predict(x)[:, 0], found.model.moment(*x.T), rtol=1e-12)
    assert found.sindy.score(x, 1e-3, x_dot=moment[:, None]) > 0.999


def test_it_prints_the_moment(found, capsys):
    found.sindy.print()
    line = capsys.readouterr().out
    assert line.startswith("M = ") and "coulomb_friction" in line and "linear_stiffness" in line


def test_it_simulates_sticking_exactly(found):
    time = np.linspace(0, 0.5, 501)
    # 1.2 N·m of elastic moment inside 1.87 N·m of friction: the joint stays where it is, to the last digit.
    stuck = found.sindy.simulate([2e-4, 0.0], time, np.zeros(501))
    assert np.all(stuck[:, 0] == 2e-4) and np.all(stuck[:, 1] == 0.0)
    moved = found.sindy.simulate([0.0, 0.0], time, 4.0 * np.sin(2 * np.pi * 4 * time))
    assert 2e-4 < np.abs(moved[:, 0]).max() < 8e-4


@pytest.mark.parametrize(
    "t, u, message",
    [
        ([0.0, 0.1, 0.2], None, "simulate needs the moment that drives the joint"),
        ([0.0, 0.1, 0.2], [1.0, 2.0], r"t has shape \(3,\) and u \(2,\)"),
        ([0.0, 0.1, 0.5], [1.0, 2.0, 3.0], "t is not evenly spaced"),
    ],
)
def test_what_cannot_be_simulated_is_one_line(found, t, u, message):
    with pytest.raises(InputError, match=message):
        found.sindy.simulate([0.0, 0.0], t, u)
