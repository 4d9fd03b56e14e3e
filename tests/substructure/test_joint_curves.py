"""Stiffness, loss and energy of a joint against closed forms; their intervals against draws."""

import numpy as np
import pytest

from sindyjoint.mechanics.laws import INTER_PANEL, FormulaLaw
from sindyjoint.response.model_law import draw_models, model_law
from sindyjoint.substructure.joint_curves import MEASURES, loop_measures, model_curve
from tests.made_models import paper_model

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
    from tests.substructure.test_harmonic_balance import jenkins

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
