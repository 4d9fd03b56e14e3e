"""One joint in motion, against closed forms and an independent solver."""

import numpy as np
import pytest
import sympy
from hybrid_reference import solve_stick_slip
from scipy.integrate import solve_ivp

from sindyjoint.equation import variable_symbols
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics import (
    INTER_PANEL,
    PANEL_ROOT,
    FormulaLaw,
    FunctionLaw,
    PaperLaw,
    SumLaw,
    harmonic,
    pulse,
    sampled,
    simulate,
    simulate_many,
    slip_direction,
    transfer_moment,
)
from sindyjoint.response import simulate_segments

NO_MOMENT = harmonic(0.0, 1.0)


def jenkins(theta, omega, direction, state, parameters, out):
    """Spring in series with a Coulomb slider; parameters stiffness, slip moment."""
    out[0] = state[0]
    sliding = abs(state[0]) >= parameters[1] and state[0] * omega > 0
    out[1] = 0.0 if sliding else parameters[0] * omega


def peaks(angle):
    extreme = (angle[1:-1] - angle[:-2]) * (angle[2:] - angle[1:-1]) <= 0
    return np.abs(angle[1:-1][extreme])


def test_coulomb_ring_down_loses_two_friction_over_stiffness_per_half_cycle():
    # den Hartog 1931: the amplitude falls by 2·M_F/k1 each half cycle, whatever the inertia
    law = PaperLaw(k1=1000.0, M_F=0.05, inertia=0.1)
    period = 2 * np.pi * np.sqrt(law.inertia / law.k1)
    start = 20.3 * law.M_F / law.k1
    motion = simulate(law, NO_MOMENT, 12 * period, 2000 / period, initial=(start, 0.0), rtol=1e-11)
    turns = motion.angle[::1000][:10]
    expected = (start - 2 * law.M_F / law.k1 * np.arange(10)) * (-1.0) ** np.arange(10)
    np.testing.assert_allclose(turns, expected, rtol=1e-8)
    # it ends inside the dead band and stays there, bit for bit
    last = motion.angle[motion.stuck]
    assert np.ptp(last[-500:]) == 0.0
    assert abs(last[-1]) <= law.M_F / law.k1
    assert np.all(motion.rate[motion.stuck] == 0)


def test_joint_inside_its_dead_band_stays_put_exactly():
    law = PaperLaw(k1=1000.0, c1=1.0, M_F=1.0)
    motion = simulate(law, harmonic(0.4, 5.0), 3.0, 500.0, initial=(5e-4, 0.0))
    assert motion.stuck.all()
    assert np.all(motion.angle == 5e-4)
    assert np.all(motion.acceleration == 0)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (PaperLaw(k1=500.0, M_F=2.0), lambda amplitude, omega: 4 * 2.0 * amplitude),
        (
            PaperLaw(k1=500.0, k2=1e4, k3=-1e7, c1=3.0),
            lambda amplitude, omega: np.pi * 3.0 * omega * amplitude**2,
        ),
    ],
    ids=["coulomb", "viscous"],
)
def test_energy_per_cycle(law, expected):
    amplitude, frequency, n = 5e-4, 4.0, 20_000
    t = np.arange(n) / (n * frequency)
    tone = harmonic(amplitude, frequency, phase=0.001)
    rate = tone.derivative(t)
    moment, _ = transfer_moment(law, tone(t), rate, n * frequency, acceleration=tone.derivative(t, 2))
    loop = np.mean(moment * rate) / frequency
    # 1e-4: the rectangle rule over the two jumps of Coulomb friction, whose rate is below 1e-3 of its peak there
    assert loop == pytest.approx(expected(amplitude, 2 * np.pi * frequency), rel=1e-4)


def test_jenkins_loop_area():
    # 4·T_s·(A − T_s/k): Jenkins 1962
    stiffness, slip, amplitude, frequency, rate = 2000.0, 0.4, 6e-4, 4.0, 40_000.0
    law = FunctionLaw(jenkins, (stiffness, slip), n_states=1)
    t = np.arange(round(rate)) / rate
    tone = harmonic(amplitude, frequency)
    moment, state = transfer_moment(law, tone(t), tone.derivative(t), rate)
    one_cycle = slice(round(2 * rate / frequency), round(3 * rate / frequency))
    area = np.sum(moment[one_cycle] * tone.derivative(t[one_cycle])) / rate
    assert area == pytest.approx(4 * slip * (amplitude - slip / stiffness), rel=2e-3)
    assert np.abs(state).max() == pytest.approx(slip, rel=2e-3)


def relaxing(theta, omega, direction, state, p, out):
    out[0] = state[0]
    out[1] = omega - state[0] / p[0]


def test_a_state_that_settles_within_a_step_is_followed():
    # Maxwell: z = ω·τ/(1 + (ωτ)²)·(cos + ωτ·sin); an eighth of a sample is 12 relaxation times
    tau, frequency, rate = 1e-4, 4.0, 100.0
    t = np.arange(200) / rate
    tone, w = harmonic(1e-3, frequency), 2 * np.pi * frequency
    moment, _ = transfer_moment(FunctionLaw(relaxing, (tau,), n_states=1), tone(t), tone.derivative(t), rate)
    response = tau * w / (1 + 1j * tau * w) * 1j
    expected = np.imag(1e-3 * response * np.exp(1j * w * t))
    assert moment[10:] == pytest.approx(expected[10:], abs=0.01 * tau * w * 1e-3)


def test_a_state_that_no_step_follows_is_an_error_and_no_warning():
    # Warnings are errors here: at 1e-13 s the rate of a state that is still finite has no bound.
    tone, t = harmonic(1e-3, 4.0), np.arange(200) / 100.0
    with pytest.raises(SimulationError, match="an internal state is no longer finite at t = "):
        transfer_moment(FunctionLaw(relaxing, (1e-13,), n_states=1), tone(t), tone.derivative(t), 100.0)


def test_softening_frequency_shift():
    # Duffing, first order: ω = ω0·(1 + 3·k3·A²/(8·k1)); the remainder is O(A⁴): Nayfeh & Mook 1979, section 2.3
    law = PaperLaw(k1=1000.0, k3=-1e9, inertia=0.1)
    omega0 = np.sqrt(law.k1 / law.inertia)
    errors = []
    for amplitude in (1e-4, 2e-4):
        motion = simulate(
            law, NO_MOMENT, 60 * 2 * np.pi / omega0, 20_000, initial=(amplitude, 0.0), rtol=1e-11
        )
        down = np.flatnonzero((motion.angle[:-1] > 0) & (motion.angle[1:] <= 0))
        a, b = motion.angle[down], motion.angle[down + 1]
        crossings = motion.time[down] + a / (a - b) / motion.sample_rate
        omega = 2 * np.pi * (crossings.size - 1) / (crossings[-1] - crossings[0])
        shift = 3 * law.k3 * amplitude**2 / (8 * law.k1)
        errors.append(abs(omega / omega0 - 1 - shift))
        assert errors[-1] < 0.02 * abs(shift)
    assert errors[1] / errors[0] == pytest.approx(16, rel=0.15)


@pytest.mark.parametrize("law", [INTER_PANEL, PANEL_ROOT], ids=["inter-panel", "panel-root"])
@pytest.mark.parametrize(("amplitude", "frequency"), [(5.0, 4.0), (3.1, 6.0)])
def test_agrees_with_solve_ivp_with_events(law, amplitude, frequency):
    duration, rate = 1.0, 1000.0

    def moment(t):
        return amplitude * np.sin(2 * np.pi * frequency * t)

    motion = simulate(law, harmonic(amplitude, frequency), duration, rate, rtol=1e-10)
    angle, speed = solve_stick_slip(law, moment, duration, motion.time)
    assert np.abs(motion.angle - angle).max() < 1e-6 * np.abs(angle).max()
    assert np.abs(motion.rate - speed).max() < 1e-6 * np.abs(speed).max()
    assert 0.2 < motion.stuck.mean() < 0.7


def test_rig_drive_agrees_with_solve_ivp_with_events():
    motion = simulate(INTER_PANEL, harmonic(3.0, 5.0), 1.0, 1000.0, beam_inertia=5.0, rtol=1e-10)
    angle, _ = solve_stick_slip(
        INTER_PANEL, lambda t: 3.0 * np.sin(10 * np.pi * t), 1.0, motion.time, inertia=5.02
    )
    assert np.abs(motion.angle - angle).max() < 1e-6 * np.abs(angle).max()


def test_convergence_is_of_fifth_order():
    law = PaperLaw(k1=1000.0, k3=-1e9, c1=1.0, inertia=0.1)
    options = {"initial": (3e-4, 0.0), "limits": None}
    exact = simulate(law, harmonic(0.1, 3.0), 0.5, 400.0, rtol=1e-13, **options).angle
    # A tolerance of nearly one lets max_step rule. Samples and steps coincide, so no interpolation enters.
    steps = np.array([1 / 400, 1 / 800, 1 / 1600])
    errors = [
        np.abs(
            simulate(law, harmonic(0.1, 3.0), 0.5, 400.0, rtol=0.99, max_step=h, **options).angle - exact
        ).max()
        for h in steps
    ]
    orders = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert np.all(orders > 4.2), (errors, orders)


def test_sensor_moment_is_inertia_moment_plus_law():
    motion = simulate(INTER_PANEL, harmonic(3.0, 5.0), 2.0, 1000.0, beam_inertia=5.0, rtol=1e-9)
    moving = ~motion.stuck
    law = INTER_PANEL.moment(motion.angle, motion.rate, np.sign(motion.rate))
    expected = INTER_PANEL.inertia * motion.acceleration + law
    assert np.abs(motion.moment - expected)[moving].max() < 1e-5 * np.abs(motion.moment).max()


def test_measured_moment_gives_the_motion_back():
    first = simulate(INTER_PANEL, harmonic(5.0, 4.0), 2.0, 1000.0)
    again = simulate(INTER_PANEL, sampled(first.moment, 1000.0), 2.0, 1000.0)
    assert np.abs(again.angle - first.angle).max() < 1e-5 * np.abs(first.angle).max()
    # 10 %: white noise of 1 % on the input must stay small in the output, and sticking must survive it
    noisy = first.moment + 0.03 * np.random.default_rng(3).standard_normal(first.moment.size)
    rough = simulate(INTER_PANEL, sampled(noisy, 1000.0, "linear"), 2.0, 1000.0)
    assert np.abs(rough.angle - first.angle).max() < 0.1 * np.abs(first.angle).max()
    assert rough.stuck.mean() > 0.2


def test_windows_restart_from_the_measured_state():
    # a pure mass has no restoring stiffness: a moment offset makes it drift, multiple shooting keeps it near
    law = PaperLaw(k1=0.0, c1=0.5, inertia=0.1)
    truth = simulate(law, harmonic(1.0, 2.0), 4.0, 500.0)
    biased = truth.moment + 0.05
    start = np.stack([truth.angle, truth.rate], axis=1)
    free = simulate(law, sampled(biased, 500.0, "linear"), 4.0, 500.0)
    segmented = simulate_segments(law, biased, 500.0, 0.5, start)
    drift, kept = (np.abs(m.angle - truth.angle).max() for m in (free, segmented))
    assert kept < drift / 5
    assert segmented.angle.size == truth.angle.size
    assert segmented.angle[250] == truth.angle[250]
    with pytest.raises(InputError, match="window is 0.004 s at 500.0 Hz; expected at least four samples"):
        simulate_segments(law, biased, 500.0, 0.004, start)


def test_formula_function_and_paper_law_move_alike():
    theta, omega, k1, k2, k3, c1, friction = sympy.symbols("theta omega k1 k2 k3 c1 M_F")
    values = dict(zip(("k1", "k2", "k3", "c1", "M_F"), INTER_PANEL.parameters.tolist(), strict=True))
    expression = k1 * theta + k2 * theta**2 + k3 * theta**3 + c1 * omega + friction * sympy.sign(omega)
    formula = FormulaLaw(expression, values, inertia=INTER_PANEL.inertia)
    paper = simulate(INTER_PANEL, harmonic(5.0, 4.0), 1.0, 1000.0)
    other = simulate(formula, harmonic(5.0, 4.0), 1.0, 1000.0)
    np.testing.assert_allclose(other.angle, paper.angle, rtol=0, atol=1e-10 * np.abs(paper.angle).max())
    np.testing.assert_allclose(
        formula.moment([1e-4, 2e-4], 0.01, [1, -1]), INTER_PANEL.moment(np.array([1e-4, 2e-4]), 0.01, [1, -1])
    )


def test_a_formula_is_interpreted_without_compiling_it():
    theta, omega, k, c = sympy.symbols("theta omega k c", real=True)
    drive = harmonic(3.0, 4.0)
    law = FormulaLaw(k * theta + c * omega + sympy.sign(omega), {"k": 5e3, "c": 60.0}, inertia=0.02)
    other = FormulaLaw(theta**3, inertia=0.02)
    assert law.compiled().address == other.compiled().address != INTER_PANEL.compiled().address
    paper = simulate(PaperLaw(5e3, c1=60.0, M_F=1.0), drive, 1.0, 1000.0).angle
    np.testing.assert_allclose(
        simulate(law, drive, 1.0, 1000.0).angle, paper, rtol=0, atol=1e-9 * paper.max()
    )


def test_parameter_sets_are_those_of_the_law_whether_interpreted_or_a_sum():
    theta, k = sympy.symbols("theta k", real=True)
    spring = FormulaLaw(k * theta, {"k": 500.0})
    both = SumLaw(SumLaw(INTER_PANEL, spring), FunctionLaw(jenkins, (500.0, 0.1), n_states=1))
    assert both.compiled().parameters.tolist() == [*INTER_PANEL.parameters, 500.0, 500.0, 0.1]
    sets = np.tile(both.compiled().parameters, (3, 1))
    sets[:, 5] *= (0.5, 1.0, 2.0)
    many = simulate_many(both, [harmonic(3.0, 4.0)], 1.0, 500.0, parameters=sets)
    stiff = SumLaw(SumLaw(INTER_PANEL, spring.with_parameters({"k": 1000.0})), both.second)
    np.testing.assert_array_equal(many.angle[2], simulate(stiff, harmonic(3.0, 4.0), 1.0, 500.0).angle)
    assert np.abs(many.angle[2] - many.angle[0]).max() > 0.01 * np.abs(many.angle).max()
    with pytest.raises(InputError, match=r"parameters have shape \(3, 7\); expected \(3, 8\)"):
        simulate_many(both, [harmonic(3.0, 4.0)], 1.0, 500.0, parameters=sets[:, 1:])


def test_sum_of_laws_keeps_states_apart():
    a = FunctionLaw(jenkins, (2000.0, 0.4), n_states=1, inertia=0.02)
    b = FunctionLaw(jenkins, (500.0, 0.1), n_states=1)
    both = SumLaw(SumLaw(INTER_PANEL, a), b)
    state = np.array([[0.1, -0.2], [0.05, 0.1]])
    parts = [INTER_PANEL.moment([1e-4, 2e-4], 0.01, 1.0), a.moment([1e-4, 2e-4], 0.01, 1.0, state[:1])]
    parts.append(b.moment([1e-4, 2e-4], 0.01, 1.0, state[1:]))
    np.testing.assert_allclose(both.moment([1e-4, 2e-4], 0.01, 1.0, state), sum(parts))
    np.testing.assert_allclose(both.state_rate([1e-4, 2e-4], 0.01, 1.0, state)[:, 0], [20.0, 5.0])
    motion = simulate(both, harmonic(5.0, 4.0), 1.0, 1000.0, rtol=1e-8)
    # the states seen along the motion agree with those integrated along the recorded motion
    _, along = transfer_moment(both, motion.angle, motion.rate, 1000.0, substeps=16)
    assert np.abs(along - motion.state).max() < 0.02 * np.abs(motion.state).max()


def test_many_runs_and_parameter_sets_at_once():
    stiffness = np.linspace(0.9, 1.1, 7)
    sets = np.tile(INTER_PANEL.parameters, (7, 1))
    sets[:, 0] *= stiffness
    many = simulate_many(INTER_PANEL, [harmonic(4.5, 4.0)], 1.0, 500.0, parameters=sets, threads=2)
    for i in (0, 6):
        law = PaperLaw(*sets[i])
        np.testing.assert_array_equal(many.angle[i], simulate(law, harmonic(4.5, 4.0), 1.0, 500.0).angle)
    excitations = [harmonic(4.0, f) for f in (3.0, 5.0)] + [pulse(4.0, 0.1, "half-sine")]
    several = simulate_many(INTER_PANEL, excitations, 1.0, 500.0)
    np.testing.assert_array_equal(several.angle[2], simulate(INTER_PANEL, excitations[2], 1.0, 500.0).angle)


@pytest.mark.parametrize("shape", ["rectangular", "half-sine"])
def test_pulse_moves_the_joint_and_leaves_it_stuck(shape):
    motion = simulate(INTER_PANEL, pulse(4.0, 0.05, shape), 1.0, 1000.0)
    assert motion.stuck[-1] and motion.angle[-1] != 0
    assert abs(INTER_PANEL.moment(motion.angle[-1:], 0.0, 0.0)[0]) <= INTER_PANEL.M_F * (1 + 1e-9)


def test_odd_law_answers_odd():
    law = PaperLaw(k1=6000.0, k3=-2.5e9, c1=48.0, M_F=1.9)
    up, down = (simulate(law, harmonic(a, 4.0), 1.0, 1000.0).angle for a in (5.0, -5.0))
    np.testing.assert_array_equal(up, -down)


def test_crossing_the_softening_limit_is_an_error_with_its_time():
    with pytest.raises(SimulationError, match=r"left its range .* at t = 0\.046.* softening limit") as caught:
        simulate(INTER_PANEL, harmonic(7.5, 4.0), 1.0, 1000.0)
    assert caught.value.time == pytest.approx(0.0469, abs=1e-3)


def test_snap_through_without_limits_ends_in_a_state_that_is_not_finite():
    with pytest.raises(SimulationError, match="no longer finite at t = |fell to nothing at t = "):
        simulate(INTER_PANEL, harmonic(9.0, 4.0), 1.0, 1000.0, limits=None)


def test_active_friction_is_refused():
    def negative_friction(theta, omega, direction, state, parameters, out):
        out[0] = 100.0 * theta - 0.5 * direction

    with pytest.raises(SimulationError, match="came to a standstill with negative friction"):
        simulate(FunctionLaw(negative_friction, inertia=0.1), harmonic(1.0, 2.0), 1.0, 500.0)


def test_law_that_cannot_be_compiled_is_named():
    def fancy(theta, omega, direction, state, parameters, out):
        out[0] = {"a": theta}.no_such_method()

    with pytest.raises(InputError, match="law function 'fancy' cannot be compiled"):
        FunctionLaw(fancy, inertia=0.1).compiled()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration": 0.0}, "at least two samples"),
        ({"rtol": 0.0}, "1e-13 ≤ rtol"),
        ({"parameters": [[1.0, 2.0]]}, "one row of the law's parameters per run"),
        ({"limits": "hard"}, "'softening', a pair of angles or None"),
        ({"law": PaperLaw(k1=1.0, inertia=0.0)}, "needs a positive one"),
    ],
)
def test_bad_calls_report_what_is_expected(change, message):
    arguments = {
        "law": INTER_PANEL,
        "excitation": harmonic(1.0, 2.0),
        "duration": 1.0,
        "sample_rate": 100.0,
    } | change
    with pytest.raises(InputError, match=message):
        simulate(arguments.pop("law"), arguments.pop("excitation"), **arguments)


def test_bad_laws_report_what_is_expected():
    with pytest.raises(InputError, match="M_F is -1"):
        PaperLaw(k1=1.0, M_F=-1)
    with pytest.raises(InputError, match="k1 is nan"):
        PaperLaw(k1=float("nan"))
    with pytest.raises(InputError, match="uses q without a value"):
        FormulaLaw(sympy.Symbol("q") * sympy.Symbol("theta"))


def test_slip_direction_keeps_the_side_of_the_motion_before():
    assert slip_direction([0, 0, -1, 0, 2, 0]).tolist() == [-1, -1, -1, -1, 1, 1]
    assert slip_direction([0.0, 0.0]).tolist() == [1, 1]


def test_softening_limits_of_the_papers_joints():
    for law, symmetric in ((INTER_PANEL, 8.68e-4), (PANEL_ROOT, 7.25e-4)):
        assert law.softening_angle == pytest.approx(symmetric, rel=2e-3)
        low, high = law.softening_limit
        tangent = [law.k1 + 2 * law.k2 * x + 3 * law.k3 * x**2 for x in (low, high)]
        np.testing.assert_allclose(tangent, 0, atol=1e-9 * law.k1)
        assert low < 0 < high


def test_a_state_that_another_state_moves_starts_from_nothing():
    """Two lags in a row answer with the fourth power of time; SciPy, with an absolute tolerance, is the reference."""
    theta, omega, _ = variable_symbols()
    first, second = sympy.Symbol("q", real=True), sympy.Symbol("r", real=True)
    rates = {"q": (theta - first) / 0.5, "r": (first - second) / 0.5}
    law = FormulaLaw(1000 * theta + 5 * omega + 200 * (theta - second), {}, rates, inertia=1.0)
    motion = simulate(law, harmonic(5.0, 4.0), 2.0, 1000.0)

    def flow(t, y):
        moment = 1000 * y[0] + 5 * y[1] + 200 * (y[0] - y[3])
        return y[1], 5.0 * np.sin(2 * np.pi * 4.0 * t) - moment, (y[0] - y[2]) / 0.5, (y[2] - y[3]) / 0.5

    other = solve_ivp(flow, (0, 2.0), np.zeros(4), "DOP853", t_eval=motion.time, rtol=1e-10, atol=1e-14)
    assert motion.angle == pytest.approx(other.y[0], abs=1e-7 * np.abs(other.y[0]).max())
    # Between the integrator's steps a state is read from a cubic.
    assert motion.state[1] == pytest.approx(other.y[3], abs=1e-6 * np.abs(other.y[3]).max())
