"""Harmonic balance and the curves of single joints, against closed forms and other integrations."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.mechanics import INTER_PANEL, FormulaLaw, PaperLaw, SumLaw, load_rig, respond, sampled
from sindyjoint.response import draw_models, model_law
from sindyjoint.substructure import (
    MEASURES,
    Balance,
    frequency_response,
    loop_measures,
    mode_over_amplitude,
    model_curve,
    slip_amplitudes,
    steady_states,
)
from tests.made_models import paper_model

STIFF = 10.0


def oscillator(law, harmonics):
    """Return a joint of inertia 1 pushed through a spring: the point before it has no mass, so it feels all force."""
    stiffness = STIFF * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return Balance(
        np.diag([1.0, 1e-9]), 0 * stiffness, stiffness, (law,), np.array([0.0, 1.0]), harmonics,
        np.array([law.k1 if isinstance(law, PaperLaw) else 1.0]), np.array([3.0]),
    )  # fmt: skip


def at(curve, frequency, values):
    order = np.argsort(curve.frequency)
    return float(np.interp(frequency, curve.frequency[order], values[order]))


def peak_angle(balance, frequency, force):
    """Return the peak angle at one frequency, at which a curve begins."""
    return frequency_response(balance, force, (frequency, 1.001 * frequency)).angle[0, 0]


def den_hartog(beta, friction):
    """Peak of x″ + x + F·sign x′ = cos βt in motion without stops (Den Hartog, Trans. ASME 53, 1931, Eq. 12)."""
    amplification = 1 / (1 - beta**2)
    damping = np.sin(np.pi / beta) / (beta * (1 + np.cos(np.pi / beta)))
    return np.sqrt(amplification**2 - (friction * damping) ** 2)


def moreau(beta, friction, periods=40, samples=1500):
    """Peak of the same oscillator, with stops, by Moreau's time stepping (impulses projected onto the cone)."""
    step = 2 * np.pi / beta / samples
    x, v, peak = 0.0, 0.0, 0.0
    push = np.cos(beta * step * (np.arange(samples) + 0.5))
    for period in range(periods):
        for force in push.tolist():
            middle = x + 0.5 * step * v
            v += step * (force - middle)
            slip = abs(v) - step * friction
            v = (slip if v > 0 else -slip) if slip > 0 else 0.0
            x = middle + 0.5 * step * v
            if period == periods - 1 and abs(x) > peak:
                peak = abs(x)
    return peak


@pytest.mark.parametrize(("beta", "friction"), [(0.7, 0.25), (0.9, 0.4), (1.25, 0.5), (1.6, 0.2)])
def test_coulomb_oscillator_moves_as_den_hartogs_closed_form(beta, friction):
    # The joint holds m·ω²·L·w of the lumped mass, and a tenth as much of the beam.
    # is 0.1 to 0.6 % of the peak with 41 of them.
    balance = oscillator(PaperLaw(k1=1.0, M_F=friction, inertia=0.0), 41)
    found = peak_angle(balance, beta / (2 * np.pi), 1.0)
    assert found == pytest.approx(den_hartog(beta, friction), rel=7e-3)


@pytest.mark.parametrize(("beta", "friction"), [(0.4, 0.7), (0.55, 0.8)])
def test_coulomb_oscillator_with_stops_moves_as_moreaus_time_stepping(beta, friction):
    balance = oscillator(PaperLaw(k1=1.0, M_F=friction, inertia=0.0), 21)
    peak = moreau(beta, friction, periods=6)
    assert peak_angle(balance, beta / (2 * np.pi), 1.0) == pytest.approx(peak, rel=1e-2)
    # The closed form for motion without stops does not hold here: the check would notice.
    with np.errstate(invalid="ignore"):
        assert not abs(den_hartog(beta, friction) / peak - 1) < 0.02


def test_a_joint_below_its_friction_does_not_move():
    balance = oscillator(PaperLaw(k1=1.0, M_F=1.5, inertia=0.0), 9)
    assert peak_angle(balance, 0.1, 1.0) < 1e-9


def duffing_folds(damping, cubic, force):
    """Fold frequencies of one harmonic, [(1 + ¾k3A² − ω²)² + (cω)²]·A² = P², from where dω/dA changes its sign."""
    amplitude = np.linspace(0.05, force / damping * 1.05, 400_000)
    stiff = 1 + 0.75 * cubic * amplitude**2
    half = stiff - damping**2 / 2
    root = half**2 - stiff**2 + (force / amplitude) ** 2
    upper = np.sqrt(half[root >= 0] + np.sqrt(root[root >= 0]))
    with np.errstate(invalid="ignore"):
        lower = np.sqrt(half[root >= 0] - np.sqrt(root[root >= 0]))
    branch = np.concatenate([lower[np.isfinite(lower)], upper[::-1]])
    turns = np.flatnonzero(np.diff(np.sign(np.diff(branch))))
    return sorted(float(branch[i + 1]) / (2 * np.pi) for i in turns)


def test_folds_of_a_duffing_oscillator_are_found():
    law = PaperLaw(k1=1.0, k3=0.02, c1=0.05, inertia=0.0)
    curve = frequency_response(oscillator(law, 1), 0.15, (0.12, 0.22))
    truth = duffing_folds(0.05, 0.02, 0.15)
    assert sorted(curve.folds) == pytest.approx(truth, rel=5e-4)
    assert not curve.stable.all()
    more = frequency_response(oscillator(law, 7), 0.15, (0.12, 0.22))
    assert sorted(more.folds) == pytest.approx(truth, rel=3e-3)


@pytest.fixture(scope="module")
def pulse_rig():
    return load_rig("pulse-rig")


def test_response_is_that_of_the_simulation(pulse_rig):
    structure, force, frequency = pulse_rig.structure(), 0.8, 4.25
    rate = 200 * frequency
    push = sampled(force * np.sin(2 * np.pi * np.arange(200 * 40 + 2) / 200), rate)
    simulated = respond(structure, push, "tip", duration=40 / frequency, sample_rate=rate, step=5e-4)
    turns = np.exp(-2j * np.pi * np.arange(200) / 200)
    truth = 2 * abs(np.mean(simulated.displacement["tip"][-200:] * turns))
    balance = Balance.of(structure, "tip")
    curve = frequency_response(balance, force, (4.0, 4.3))
    assert np.exp(at(curve, frequency, np.log(curve.amplitude))) == pytest.approx(truth, rel=3e-3)
    angle = float(np.ptp(simulated.angle[0, -200:])) / 2
    assert at(curve, frequency, curve.angle[0]) == pytest.approx(angle, rel=5e-3)


def test_backbone_runs_through_the_peaks_and_begins_where_the_joint_slips(pulse_rig):
    structure = pulse_rig.structure()
    balance = Balance.of(structure, "tip", harmonics=9)
    mode = mode_over_amplitude(balance, 1, "tip", np.array([4e-4]))
    stuck = mode.amplitude < mode.slips[0]
    assert np.ptp(mode.frequency[stuck]) < 1e-6 * mode.frequency[0]
    assert mode.frequency[0] == pytest.approx(structure.frequencies(1, locked=True)[0], rel=1e-6)
    # A loss factor of 0.004 holds at the first mode with a sliding joint; its damper gives more at a higher frequency.
    assert mode.damping[stuck] == pytest.approx(
        0.002 * mode.frequency[0] / structure.frequencies(1)[0], rel=1e-3
    )
    assert np.all(np.diff(mode.frequency[~stuck]) < 0)
    curve = frequency_response(balance, 0.8, (4.0, 4.6))
    frequency, amplitude = curve.peak
    assert np.interp(amplitude, mode.amplitude, mode.frequency) == pytest.approx(frequency, rel=5e-3)
    assert np.interp(amplitude, mode.amplitude, mode.force) == pytest.approx(0.8, rel=0.02)


def test_damping_is_the_energy_that_the_joint_takes(pulse_rig):
    # Beams without loss, a joint without viscous damping: 4·M_F·θ per cycle, stick or slip.
    balance = Balance.of(pulse_rig.structure(), "tip", harmonics=9)
    law = replace(INTER_PANEL, c1=0.0)
    lossless = replace(balance, damping=0 * balance.damping, laws=(law,))
    mode = mode_over_amplitude(lossless, 1, "tip", np.array([5e-4]))
    supplied = np.pi * mode.force[-1] * mode.amplitude[-1]
    assert supplied == pytest.approx(4 * law.M_F * mode.angle[0, -1], rel=0.01)


def jenkins(stiffness, yields):
    from sympy import Abs, Heaviside, Symbol, symbols

    z, omega = Symbol("z", real=True), Symbol("omega", real=True)
    kt, limit = symbols("kt limit", real=True)
    full = Heaviside(Abs(z) - limit, 1) * Heaviside(z * omega, 0)
    return FormulaLaw(kt * z, {"kt": stiffness, "limit": yields}, {"z": omega * (1 - full)})


SLIDER = jenkins(1.0, 0.4)


def caughey(size, stiffness, yields):
    """In-phase and quadrature stiffness of a Jenkins element that slips at one harmonic.

    Caughey, Sinusoidal excitation of a system with bilinear hysteresis, J. Applied Mechanics 27, 1960, p. 640.
    """
    turn = np.arccos(1 - 2 * yields / size)
    return stiffness * (turn - 0.5 * np.sin(2 * turn)) / np.pi, stiffness * np.sin(turn) ** 2 / np.pi


def bilinear_force(size, omega):
    """Force that moves a unit mass on a spring 1, a damper 0.05 and a Jenkins element (0.5, 0.4) at one harmonic."""
    inphase, quadrature = caughey(size, 0.5, 0.4)
    return size * np.abs(1 + inphase - omega**2 + 1j * (0.05 * omega + quadrature))


def test_a_bilinear_oscillator_follows_caugheys_curve():
    """The resonance curve over its peak; the closed form has one harmonic, the balance five."""
    law = SumLaw(PaperLaw(k1=1.0, c1=0.05, inertia=0.0), jenkins(0.5, 0.4))
    curve = frequency_response(oscillator(law, 5), 0.3, (0.14, 0.2))
    size, omega = curve.angle[0], 2 * np.pi * curve.frequency
    slips = size > 0.45
    assert np.count_nonzero(slips) > 10
    assert bilinear_force(size, omega)[slips] == pytest.approx(0.3, rel=0.01)
    # At the peak the force meets the damping alone.
    top = np.argmax(size)
    quadrature = caughey(size[top], 0.5, 0.4)[1]
    assert size[top] * (quadrature + 0.05 * omega[top]) == pytest.approx(0.3, rel=0.01)
    assert 0 < top < size.size - 1


@pytest.mark.parametrize("size", [0.6, 1.0, 3.0])
def test_a_slider_stops_at_its_limit(size):
    """The moment of a Jenkins element over a period, beside the play operator; up to a step past it the curve jumps."""
    phase = 2 * np.pi * np.arange(240) / 240
    z = steady_states(SLIDER, size * np.cos(phase), -size * np.sin(phase), 2 * np.pi)[0]
    exact, play = 0.0, []
    for step in np.diff(size * np.cos(2 * np.pi * np.arange(481) / 240)):
        exact = float(np.clip(exact + step, -0.4, 0.4))
        play.append(exact)
    assert z == pytest.approx(np.roll(play[240:], 1), abs=1e-7 * size)


def test_derivatives_of_a_law_with_an_internal_state_lead_to_the_solution():
    law = SumLaw(PaperLaw(k1=1.0, c1=0.05, inertia=0.0), jenkins(0.5, 0.4))
    size = peak_angle(oscillator(law, 5), 0.16, 0.3)
    # What the closed form leaves out are the higher harmonics.
    assert bilinear_force(size, 2 * np.pi * 0.16) == pytest.approx(0.3, rel=0.015)


def test_slip_begins_where_a_static_moment_would_reach_the_friction(pulse_rig):
    # The joint holds m·ω²·L·w of the lumped mass, and a tenth as much of the beam.
    structure = pulse_rig.structure()
    slips = slip_amplitudes(Balance.of(structure, "tip"), 1)
    omega = 2 * np.pi * structure.frequencies(1, locked=True)[0]
    assert slips[0] == pytest.approx(INTER_PANEL.M_F / (8.0 * omega**2 * 0.5), rel=0.1)


def test_negative_friction_and_a_missing_joint_are_refused(pulse_rig):
    balance = oscillator(FormulaLawOf("-2*sign(omega) + theta"), 3)
    with pytest.raises(InputError, match="negative friction"):
        peak_angle(balance, 0.1, 1.0)
    beams = tuple(item for item in pulse_rig.items if getattr(item, "law", None) is None)
    with pytest.raises(InputError, match="no joint"):
        Balance.of(replace(pulse_rig, items=beams).structure(), "tip")


def FormulaLawOf(text):  # noqa: N802
    from sympy import Symbol, sympify

    names = {name: Symbol(name, real=True) for name in ("theta", "omega")}
    return FormulaLaw(sympify(text, locals=names))


SIZES = np.geomspace(1e-5, 8e-4, 7)


def test_the_papers_law_has_its_closed_forms():
    law, frequency = INTER_PANEL, 4.0
    secant, storage, loss, energy = loop_measures(law, SIZES, frequency)
    elastic = law.k1 + 0.75 * law.k3 * SIZES**2
    work = np.pi * law.c1 * 2 * np.pi * frequency * SIZES**2 + 4 * law.M_F * SIZES
    assert secant == pytest.approx(law.k1 + law.k3 * SIZES**2, rel=1e-9)
    assert storage == pytest.approx(elastic, rel=1e-9)
    # The corner of |cos| between 720 samples.
    assert energy == pytest.approx(work, rel=1e-5)
    assert loss == pytest.approx(work / (np.pi * elastic * SIZES**2), rel=1e-5)


@pytest.mark.parametrize("time", [0.01, 0.1, 5.0, 50.0])
def test_a_maxwell_branch_reaches_its_steady_state_however_slowly_it_relaxes(time):
    from sympy import Symbol

    theta, omega, z = (Symbol(name, real=True) for name in ("theta", "omega", "z"))
    law = FormulaLaw(100.0 * theta + 50.0 * z, {"tau": time}, {"z": omega - z / Symbol("tau", real=True)})
    secant, storage, loss, energy = loop_measures(law, [1e-3], 4.0)
    x = 2 * np.pi * 4.0 * time
    assert storage[0] == pytest.approx(100 + 50 * x**2 / (1 + x**2), rel=1e-7)
    assert energy[0] == pytest.approx(np.pi * 1e-6 * 50 * x / (1 + x**2), rel=1e-6)


def test_a_jenkins_element_dissipates_four_times_its_moment_times_its_slip():
    law = jenkins(6000.0, 2e-4)
    _, _, _, energy = loop_measures(law, [1e-4, 5e-4], 3.0)
    assert energy[0] == pytest.approx(0.0, abs=1e-9)
    assert energy[1] == pytest.approx(4 * 6000.0 * 2e-4 * (5e-4 - 2e-4), rel=5e-3)


def test_intervals_are_those_of_drawn_models():
    model = paper_model(0.02)
    curve = model_curve(model, SIZES, 4.0)
    drawn = draw_models(model, 400, np.random.default_rng(5))
    spread = np.std([loop_measures(model_law(one), SIZES, 4.0) for one in drawn], axis=0)
    for name, row in zip(MEASURES, spread, strict=True):
        # 400 draws know a spread to 3.5 %.
        assert getattr(curve, f"{name}_error") == pytest.approx(row, rel=0.12)


def test_what_was_not_tested_is_marked():
    model = paper_model(0.02, angle=3e-4)
    curve = model_curve(model, SIZES, 4.0)
    assert curve.tested.tolist() == (SIZES <= 1.05 * 3e-4).tolist()
    # The fitted rate of 0.03 rad/s is passed at 16 Hz.
    assert model_curve(model, SIZES, 60.0).tested.sum() < curve.tested.sum()
