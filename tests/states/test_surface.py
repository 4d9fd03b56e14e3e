"""The averaged force-state map of section 4.2, and the paper's fit of it."""

import numpy as np
import pytest

from sindyjoint import simulate
from sindyjoint.errors import InputError
from sindyjoint.states import campaign_states
from sindyjoint.states.surface import fit_surface, force_state_map, map_of_states

LAW = (6066.0, -1.927e5, -2.684e9, 48.13, 1.867)


def law(angle, rate):
    k1, k2, k3, c1, friction = LAW
    return k1 * angle + k2 * angle**2 + k3 * angle**3 + c1 * rate + friction * np.sign(rate)


@pytest.fixture
def scattered():
    # 40 000 states spread evenly over the tested plane: every cell of a 40 × 40 map holds about 25.
    rng = np.random.default_rng(1)
    return rng.uniform(-8e-4, 8e-4, 40_000), rng.uniform(-0.04, 0.04, 40_000)


def test_cells_by_hand():
    angle = [-1.0, -0.9, 1.0, 0.6]
    rate = [-2.0, -1.0, 2.0, 0.5]
    found = force_state_map(angle, rate, [1.0, 3.0, 10.0, 20.0], n=2)
    assert found.count.tolist() == [[2, 0], [0, 2]]
    assert found.moment[0, 0] == 2.0 and found.moment[1, 1] == 15.0
    assert found.spread[0, 0] == 1.0 and found.spread[1, 1] == 5.0
    assert found.angle[0, 0] == -0.95 and found.rate[1, 1] == 1.25
    assert np.isnan(found.moment[0, 1]) and not found.filled[0, 1]
    assert found.rate_edges.tolist() == [-2.0, 0.0, 2.0]


def test_every_sample_is_counted_once_whatever_the_order(scattered):
    angle, rate = scattered
    moment = law(angle, rate)
    order = np.random.default_rng(2).permutation(angle.size)
    straight, shuffled = (
        force_state_map(*(s[o] for s in (angle, rate, moment))) for o in (slice(None), order)
    )
    assert straight.count.sum() == angle.size
    assert np.array_equal(straight.count, shuffled.count)
    # Sums in another order differ by rounding only.
    assert np.allclose(straight.moment, shuffled.moment, rtol=1e-12, atol=1e-12)


def test_zero_rate_is_an_edge_so_that_no_cell_averages_the_friction_step():
    rng = np.random.default_rng(3)
    angle, rate = rng.uniform(-1, 1, 5000), rng.uniform(-0.2, 1.0, 5000)
    found = force_state_map(angle, rate, np.sign(rate), n=24)
    assert 0.0 in found.rate_edges
    assert set(np.unique(found.moment[found.filled])) == {-1.0, 1.0}


def test_an_odd_law_gives_an_odd_map(scattered):
    angle, rate = scattered
    moment = 6066 * angle + 1.867 * np.sign(rate)
    whole = [np.concatenate([s, -s]) for s in (angle, rate, moment)]
    found = force_state_map(*whole, n=20)
    assert np.array_equal(found.count, found.count[::-1, ::-1])
    assert np.allclose(found.moment, -found.moment[::-1, ::-1], atol=1e-12)


def test_a_signal_that_does_not_vary_is_one_column():
    found = force_state_map(np.full(10, 0.3), np.linspace(-1, 1, 10), np.ones(10), n=4)
    assert found.count.sum() == 10 and np.count_nonzero(found.count.sum(axis=1)) == 1


def test_the_papers_fit_comes_nearer_to_the_law_as_cells_shrink(scattered):
    angle, rate = scattered
    errors = []
    for n in (10, 40):
        found = fit_surface(force_state_map(angle, rate, law(angle, rate), n))
        errors.append(np.abs(np.array(found.coefficients) / LAW - 1))
    # Averaging over a cell of width w turns θ³ into θ³ + θw²/4: the error of k1 falls with the square of w.
    assert errors[1][0] < errors[0][0] / 8
    # At 40 cells, all but the small k2 (scatter of the cells' mean states) are within 1 %.
    assert np.all(errors[1][[0, 2, 3, 4]] < 0.01)


def test_mean_states_fit_better_than_middles_of_cells():
    campaign = simulate("inter-panel", frequencies=[3], noise=0, duration=3, random_state=0)
    states = campaign_states(campaign)
    surface = map_of_states(states, campaign.joint.inertia)
    assert surface.count.sum() == sum(np.count_nonzero(s.moving) for s in states)
    middle, mean = fit_surface(surface), fit_surface(surface, at="means")
    assert mean.residual_rms < 0.5 * middle.residual_rms
    assert mean.coefficients[4] == pytest.approx(1.867, rel=0.02)


def test_sticking_samples_blur_the_friction_step():
    # Averaged in, as the paper does, they lie anywhere between the two levels: the fitted friction is too small.
    campaign = simulate("inter-panel", frequencies=[3], noise=0, duration=3, random_state=0)
    states, inertia = campaign_states(campaign), campaign.joint.inertia
    with_stuck = map_of_states(states, inertia, moving=False)
    assert with_stuck.count.sum() == sum(s.n_samples for s in states)
    friction = [
        fit_surface(m, at="means").coefficients[4] for m in (with_stuck, map_of_states(states, inertia))
    ]
    assert friction[0] < 0.9 * friction[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ([0.0, 1.0], [0.0], [0.0, 1.0]),
            r"shapes \(2,\), \(1,\) and \(2,\); expected three signals of one length",
        ),
        (([], [], []), r"shapes \(0,\).* expected three signals"),
        (([0.0], [0.0], [0.0], 1), "a map of 1 cells along each axis was asked for; expected at least 2"),
    ],
)
def test_what_cannot_be_averaged_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        force_state_map(*arguments)


def test_what_cannot_be_fitted_is_refused():
    found = force_state_map([0.0, 1.0], [-1.0, 1.0], [0.0, 1.0], n=2)
    with pytest.raises(InputError, match="2 filled cells for 5 terms; expected a finer map"):
        fit_surface(found)
    with pytest.raises(InputError, match="at is 'edges'; expected 'centres' or 'means'"):
        fit_surface(found, at="edges")
