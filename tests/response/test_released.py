"""Joints that were held, then released: what relaxes while they are held has relaxed, what has slipped has slipped."""

import numpy as np
import pytest
from scipy.linalg import expm

from sindyjoint.mechanics import FunctionLaw, PaperLaw, SumLaw
from sindyjoint.mechanics.stickslip import brought_from_rest
from sindyjoint.record import Run
from sindyjoint.response import simulate_run
from sindyjoint.states import force_states

STIFFNESS, DAMPING, BRANCH, TAU, RATE = 100.0, 0.05, 30.0, 0.1, 200.0


def branch(theta, omega, direction, state, p, out):
    """A Maxwell branch of stiffness p[0] that forgets in p[1], and a slider of limit p[2] that holds no moment."""
    out[0] = p[0] * state[0]
    out[1] = omega - state[0] / p[1]
    out[2] = omega if abs(state[1]) < p[2] or omega * state[1] < 0 else 0.0


def dashpot(theta, omega, direction, state, p, out):
    """A spring in series with a spring and a dashpot side by side: its state goes to a half of the angle."""
    out[0] = p[0] * (theta - state[0])
    out[1] = (0.5 * theta - state[0]) / p[1]


def test_while_held_a_branch_relaxes_and_a_slider_does_not():
    law = SumLaw(PaperLaw(1.0, 0.0, 0.0, 0.0, 0.0), FunctionLaw(branch, (BRANCH, TAU, 0.3), n_states=2))
    rate = np.array([0.0, 5.0])
    moving, held = (brought_from_rest(law, np.array([1.0, 0.9]), rate, held=each) for each in (False, True))
    assert moving[0] > 0.2 and held == pytest.approx([0.0, moving[1]], abs=1e-9)
    (other,) = brought_from_rest(FunctionLaw(dashpot, (BRANCH, TAU), 1), np.array([0.8]), rate, held=True)
    assert other == pytest.approx(0.4, rel=1e-6)


def test_a_release_with_a_maxwell_branch_is_followed_from_its_relaxed_state():
    """The motion is the exponential of the matrix of angle, rate and branch."""
    matrix = np.array([[0, 1, 0], [-STIFFNESS, -DAMPING, -BRANCH], [0, 1, -1 / TAU]])
    onward, state, angle = expm(matrix / RATE), np.array([0.1, 0.0, 0.0]), []
    for _ in range(1200):
        angle.append(state[0])
        state = onward @ state
    noisy = np.array(angle) + 2e-5 * np.random.default_rng(1).standard_normal(1200)
    run = Run("release", np.zeros(1200), noisy, RATE)
    law = SumLaw(
        PaperLaw(STIFFNESS, 0.0, 0.0, DAMPING, 0.0, inertia=1.0),
        FunctionLaw(branch, (BRANCH, TAU, 1.0), n_states=2),
    )
    assert simulate_run(law, run, force_states(run)).response_nrmse < 0.005
