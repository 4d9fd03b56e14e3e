"""Free swings: no moment is measured, and a small dissipation shows in how the motion goes on.

The decays are integrated by SciPy, swing by swing, with a law written here.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sindyjoint import diagnose, discover
from sindyjoint.diagnosis.campaign import HalfCycles, reversals, transition_steps
from sindyjoint.equation import load_catalogue
from sindyjoint.judgement.trust import assess
from sindyjoint.record import Campaign, Joint, Run
from tests.seeds import seeds

INERTIA, STIFFNESS, DAMPING = 1.0, 64.0, 0.05
RATE = 250.0


def decay(moment, duration=30.0, start=1.0, sample_rate=RATE):
    """Angle and rate of I·θ̈ = −moment(θ, θ̇, direction) from rest, the direction that of the swing in hand."""
    time = np.arange(int(duration * sample_rate)) / sample_rate
    angle, rate = np.full(time.size, np.nan), np.full(time.size, np.nan)
    state, now, direction = (start, 0.0), 0.0, -1.0
    while now < time[-1]:

        def flow(t, x, way=direction):
            return x[1], -moment(x[0], x[1], way) / INERTIA

        def still(t, x, way=direction):
            return way * x[1]

        still.terminal, still.direction = True, -1
        part = solve_ivp(
            flow, (now, time[-1]), state, "DOP853", rtol=1e-10, atol=1e-12, events=still, dense_output=True
        )
        inside = (time >= now) & (time <= part.t[-1])
        if inside.any():
            angle[inside], rate[inside] = part.sol(time[inside])
        now, state, direction = part.t[-1], (part.y[0, -1], 0.0), -direction
        if part.status != 1:
            break
    return time, angle, rate


def viscous(angle, rate, way):
    return DAMPING * rate + STIFFNESS * np.sin(angle)


def campaign(moment, seed, noise=2e-4):
    _, angle, _ = decay(moment)
    angle = angle + noise * np.random.default_rng(seed).standard_normal(angle.size)
    run = Run("swing", np.zeros(angle.size), angle, RATE)
    return Campaign(Joint("pendulum", inertia=INERTIA), (run,))


def base():
    return (
        load_catalogue("stiffness")
        .select(["gravity_moment"])
        .union(load_catalogue("paper").select(["linear_damping"]))
    )


def test_a_small_moment_moves_the_states_where_swings_end_as_the_rows_say():
    small = 0.01
    time, angle, rate = decay(viscous, 8.0)
    slopes = (STIFFNESS * np.cos(angle), np.full(time.size, DAMPING))
    rows = HalfCycles.build(rate, 1 / RATE, slopes, INERTIA, 1e-3, (1e-6, 1e-5))
    ends = reversals(rate, 1e-3)
    assert rows.size == 2 * rows.starts.size == 2 * (ends.size + 1)
    moved = rows.plain(-small * rate).reshape(-1, 2)
    angular = np.pi * RATE / np.median(np.diff(ends))
    for swing in (1, 4, 9):
        first, last = rows.starts[swing], rows.starts[swing + 1]
        other = solve_ivp(
            lambda t, x: (x[1], -(viscous(*x, 0) + small * x[1]) / INERTIA), (time[first], time[last]),
            (angle[first], rate[first]), rtol=1e-11, atol=1e-13,
        )  # fmt: skip
        change = other.y[:, -1] - (angle[last], rate[last])
        # A sum over samples for an integral, and a change that is 1 % of the damping: 2 % of the larger one.
        assert moved[swing] * (1, angular) == pytest.approx(change, abs=0.02 * np.abs(change).max())


@seeds(1, 2, 3)
def test_nothing_is_missing_from_a_viscous_decay(seed):
    result = diagnose(campaign(viscous, seed), base=base(), advise=False)
    assert result.verdict == "nothing_missing"


@seeds(1, 2, 3)
def test_coulomb_friction_is_named_and_the_swing_goes_on_as_said(seed):
    result = diagnose(
        campaign(lambda a, r, way: viscous(a, r, way) + 0.1 * way, seed), base=base(), advise=False
    )
    assert [s.effect for s in result.steps] == ["coulomb_friction"]
    assert result.steps[0].parameters["M_F"] == pytest.approx(0.1, rel=0.05)
    # Held out: the last third of the swing, from a fit to what comes before.
    assert result.final.response < 0.2 * result.initial.response
    # Friction is a function of the state. The moment of a free swing is that of its inertia, and says nothing of it.
    parts = {part: getattr(result.budget, part) for part in ("state", "history", "run")}
    assert max(parts, key=parts.get) == "state" and parts["state"] > 0.5 * result.budget.total


@seeds(1, 2, 3)
def test_coulomb_friction_and_quadratic_damping_that_hide_each_other_are_both_found(seed):
    def both(angle, rate, way):
        return viscous(angle, rate, way) + 0.1 * way + 0.006 * rate * abs(rate)

    result = diagnose(campaign(both, seed), base=base(), advise=False)
    members = [set(s.members) for s in result.steps]
    assert len(members) == 2 and any("coulomb_friction" in m for m in members)
    assert any("quadratic_damping" in m for m in members)
    assert result.final.response < 0.2 * result.initial.response


@pytest.mark.parametrize("damping", [0.0, 1e-3, -1e-3, 2.0, 400.0])
def test_a_step_of_the_linearised_motion_is_the_exponential_of_its_matrix(damping):
    from scipy.linalg import expm

    # Unstable, without stiffness, critically damped, and as steep as friction near a reversal.
    inertia, step, angular = 0.02, 1e-3, 30.0
    stiffness = np.array([-5.0, 0.0, damping**2 / (4 * inertia), 18.0, 500.0])
    found = transition_steps((stiffness, np.full(5, damping)), inertia, step, angular)
    for k, matrix in zip(stiffness, found, strict=True):
        rates = np.array([[0.0, angular], [-k / (inertia * angular), -damping / inertia]])
        assert np.allclose(matrix, expm(rates * step), rtol=1e-12, atol=1e-12)


def test_terms_that_feed_energy_in_beside_an_element_give_rows_all_the_same():
    """A dashpot in series with a stiff spring, and a negative damping that makes up for it: rows are finite."""
    time = np.arange(2000) / 200
    rate = np.sin(2 * np.pi * time)
    slopes = np.full(time.size, 40.0), np.full(time.size, -340.0)
    rows = HalfCycles.build(rate, 1 / 200, slopes, 1.0, 0.01, (1e-3, 1e-2))
    assert np.isfinite(rows.white(np.ones(time.size))).all()


def test_nothing_is_missing_from_a_release_that_is_over_in_a_few_swings():
    """A linear joint in closed form, 8 % of the critical damping, 45 samples a period: a search that met the above."""
    time, angular, damping, runs = np.arange(675) / 225, 10 * np.pi, 0.08, []
    damped, rng = angular * np.sqrt(1 - damping**2), np.random.default_rng(5)
    for level in (0.9, 0.7, 0.5):
        swing = np.cos(damped * time) + damping * angular / damped * np.sin(damped * time)
        angle = 1e-3 * level * np.exp(-damping * angular * time) * swing
        noisy = angle + 3e-6 * rng.standard_normal(time.size)
        runs.append(Run(f"drop {level}", np.zeros(time.size), noisy, 225.0))
    found = diagnose(Campaign(Joint(inertia=0.02), tuple(runs)), advise=False)
    assert found.verdict == "nothing_missing"
    # No moment is measured, and no effect has a probability: neither has a column.
    assert "response gap" in str(found) and "moment gap" not in str(found) and "probability" not in str(found)


def stopped(level, damping, friction, duration=10.0, steps=40):
    """Angle of I·θ̈ = −k·θ − c·θ̇ − M_F·sign θ̇ from rest: leapfrog steps, friction at most what stops the joint."""
    count = int(duration * RATE)
    angle, rate, step = level, 0.0, 1 / (RATE * steps)
    found = np.empty(count)
    for i in range(count * steps):
        if i % steps == 0:
            found[i // steps] = angle
        free = rate - step * (STIFFNESS * angle + damping * rate) / INERTIA
        rate = np.sign(free) * max(abs(free) - step * friction / INERTIA, 0.0)
        angle += step * rate
    return found


@seeds(1, 2)
def test_nothing_is_missing_where_friction_ends_the_swing(seed):
    """Smoothing rounds off what friction bends at each reversal; simulated the motion is as it was measured.

    With noise of 0.1 % of the amplitude that was "unknown", in four of six joints made otherwise.
    """
    rng = np.random.default_rng(seed)
    runs = []
    for level in (1.0, 0.8, 0.6):
        angle = stopped(level, 0.3, 2.5) + 1e-3 * rng.standard_normal(int(10 * RATE))
        runs.append(Run(f"{level:g}", np.zeros(angle.size), angle, RATE))
    result = diagnose(Campaign(Joint("stopped", inertia=INERTIA), tuple(runs)), advise=False)
    assert result.verdict == "nothing_missing" and not result.steps
    assert set(result.model.ids) == {"linear_stiffness", "linear_damping", "coulomb_friction"}


def test_friction_that_grows_with_the_angle_is_no_damping():
    """Both fade in proportion to the amplitude, and any law goes on as noise at the end of a decay.

    By that end alone nothing was missing, with a damping twice the true one. A law fitted to the simulated motion
    leaves noise, and its numbers lie within a hundredth.
    """
    rng, runs = np.random.default_rng(5), []
    for start in (1.0, 0.7):
        _, angle, _ = decay(
            lambda a, r, way: STIFFNESS * a + 0.2 * r + (0.2 + 2.0 * abs(a)) * way, 6.0, start, 500.0
        )
        angle = angle + 2e-3 * rng.standard_normal(angle.size)
        runs.append(Run(f"{start:g}", np.zeros(angle.size), angle, 500.0))
    result = diagnose(Campaign(Joint("released", inertia=INERTIA), tuple(runs)), advise=False)
    assert result.verdict == "named"
    assert [s.effect for s in result.steps] == ["position_dependent_friction"]
    assert result.steps[0].parameters["mu_a"] == pytest.approx(2.0, rel=0.05)
    assert result.model["coulomb_friction"].coefficient == pytest.approx(0.2, rel=0.05)


def test_a_release_that_is_over_after_some_swings_shows_its_law():
    """The kernel takes more than a swing off an end that is not continued; from rest the mirror image is the motion.

    Seed 4, noise of .1 % of the first height. Three standard errors of the stiffness are 1 %, of the others 2 to 7 %.
    """
    rng = np.random.default_rng(4)
    runs = []
    for level in (1.0, 0.8, 0.6):
        angle = stopped(level, 0.6, 8.0) + 1e-3 * rng.standard_normal(int(10 * RATE))
        runs.append(Run(f"{level:g}", np.zeros(angle.size), angle, RATE))
    found = discover(Campaign(Joint("released", inertia=INERTIA), tuple(runs)))
    assert set(found.model.ids) == {"linear_stiffness", "linear_damping", "coulomb_friction"}
    true = {"linear_stiffness": STIFFNESS, "linear_damping": 0.6, "coulomb_friction": 8.0}
    for name, value in true.items():
        low, high = found.model[name].interval95
        assert low < value < high and found.model[name].coefficient == pytest.approx(value, rel=0.07)
    assert not any("drive it harder" in line for line in found.warnings)


@seeds(1, 2, 3)
def test_a_slow_decay_is_no_steady_run_and_shows_what_little_damps_it(seed):
    """Noise of .5 % of the first height hides .4 and .05 in an acceleration, and not in the motion of forty cycles.

    Taken for steady, as its neighbouring cycles are alike, the decay was noise, and stiffness the whole law, with trust
    "Yes". Within 1.5 half-widths of the interval: one number in three hundred falls outside.
    """
    rng, runs = np.random.default_rng(seed), []
    for start in (1.0, 0.8, 0.6):
        _, angle, _ = decay(lambda a, r, way: STIFFNESS * a + 0.05 * r + 0.4 * way, 15.0, start)
        angle = np.where(np.isnan(angle), angle[~np.isnan(angle)][-1], angle)
        runs.append(
            Run(f"{start:g}", np.zeros(angle.size), angle + 5e-3 * rng.standard_normal(angle.size), RATE)
        )
    found = discover(Campaign(Joint("released", inertia=INERTIA), tuple(runs)))
    assert {state.method for state in found.states} == {"broadband"}
    true = {"linear_stiffness": STIFFNESS, "linear_damping": 0.05, "coulomb_friction": 0.4}
    assert set(found.model.ids) == set(true)
    for term in found.model.terms:
        low, high = term.interval95
        assert abs(term.coefficient - true[term.id]) < 0.75 * (high - low)
        assert high - low < 0.4 * true[term.id]
    wrong = [1.1 * t.coefficient if t.id == "linear_stiffness" else t.coefficient for t in found.model.terms]
    lights = assess(
        found.model.with_numbers(wrong),
        found.campaign,
        found.soundness,
        {run.name: True for run in found.campaign.runs},
    )
    assert "the simulated motion misses by" in lights[2].sentence and lights[2].colour == "poor"
