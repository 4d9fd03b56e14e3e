"""A model and the law made of it say the same, and what no law can say is refused."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.mechanics import INTER_PANEL, FormulaLaw, PaperLaw, harmonic, simulate
from sindyjoint.response import draw_models, elastic_moment, model_law, with_coefficients
from tests.made_models import model_of, paper_model, term


def states():
    generator = np.random.default_rng(3)
    return 8e-4 * generator.uniform(-1, 1, 200), 0.03 * generator.uniform(-1, 1, 200)


def test_five_terms_become_the_paper_law():
    law = model_law(paper_model())
    assert isinstance(law, PaperLaw)
    assert law == replace(INTER_PANEL, name=law.name)


@pytest.mark.parametrize(
    "formula",
    [
        "omega*abs(omega)",
        "max(theta, 0)",
        "exp(-abs(omega)/0.003)*sign(omega)",
        "heaviside(omega)*theta",
        "1",
    ],
)
def test_law_and_model_agree_wherever_the_joint_moves(formula):
    model = model_of([*paper_model().terms, term("extra", formula, 0.3)])
    law = model_law(model)
    assert isinstance(law, FormulaLaw)
    theta, omega = states()
    np.testing.assert_allclose(
        law.moment(theta, omega, np.sign(omega)), model.moment(theta, omega), rtol=1e-12
    )


def test_general_law_moves_like_the_paper_law():
    # A sixth term of size zero sends the same equation through the other kind of law.
    model = model_of([*paper_model().terms, term("quintic_stiffness", "theta**5", 0.0)])
    drive = harmonic(4.5, 4.0)
    general = simulate(model_law(model), drive, 1.0, 1000)
    special = simulate(INTER_PANEL, drive, 1.0, 1000)
    assert general.stuck.any() and not general.stuck.all()
    np.testing.assert_array_equal(general.stuck, special.stuck)
    np.testing.assert_allclose(general.angle, special.angle, atol=1e-12)


def test_softening_limit_of_a_general_law_is_where_the_tangent_vanishes():
    model = model_of([*paper_model().terms, term("quintic_stiffness", "theta**5", 0.0)])
    # Found on a grid of 3 · 0.8 mrad in 3000 steps.
    np.testing.assert_allclose(model_law(model).softening_limit, INTER_PANEL.softening_limit, atol=8e-7)


def test_no_softening_limit_without_softening():
    stiff = model_of([term("linear_stiffness", "theta", 6e3), term("cubic_damping", "omega**3", 1.0)])
    friction = model_of([term("linear_damping", "omega", 2.0), term("constant_moment", "1", 0.3)])
    for model in (stiff, friction):
        assert model_law(model).softening_limit == (-np.inf, np.inf)


def test_elastic_moment_leaves_friction_out():
    law = model_law(
        model_of([*paper_model().terms, term("position_dependent_friction", "abs(theta)*sign(omega)", 90.0)])
    )
    theta = np.linspace(-8e-4, 8e-4, 9)
    k1, k2, k3 = INTER_PANEL.k1, INTER_PANEL.k2, INTER_PANEL.k3
    np.testing.assert_allclose(
        elastic_moment(law, theta), k1 * theta + k2 * theta**2 + k3 * theta**3, atol=1e-12
    )


def test_identified_inertia_is_the_law_s_inertia_and_no_moment():
    model = model_of([*paper_model().terms, term("inertia", "alpha", 0.03)], inertia=None)
    law = model_law(model)
    assert isinstance(law, PaperLaw) and law.inertia == 0.03


def test_negative_friction_still_makes_a_law():
    values = (6e3, 0.0, 0.0, 40.0, -0.5)
    law = model_law(paper_model(values=values))
    assert not isinstance(law, PaperLaw)
    assert law.moment([0.0], [1.0], [1.0])[0] == pytest.approx(39.5)


def test_a_term_of_the_acceleration_is_refused():
    model = model_of([term("linear_stiffness", "theta", 6e3), term("mine", "alpha*abs(theta)", 1.0)])
    with pytest.raises(InputError, match=r"term 'mine' \(alpha\*abs\(theta\)\) depends on alpha"):
        model_law(model)
    sliding = replace(model, joint=replace(model.joint, motion="translation"))
    with pytest.raises(InputError, match="terms of displacement and velocity, and mass"):
        model_law(sliding)


def test_coefficients_replaced_keep_their_order_and_shape():
    model = paper_model()
    new = with_coefficients(model, 2 * model.coefficients, np.diag([1.0, 2.0, 3.0, 4.0, 5.0]) ** 2)
    np.testing.assert_array_equal(new.coefficients, 2 * model.coefficients)
    np.testing.assert_array_equal(new.standard_errors, [1, 2, 3, 4, 5])
    assert new.terms[0].interval95 == pytest.approx((2 * 6066 - 1.96, 2 * 6066 + 1.96))
    with pytest.raises(
        InputError, match=r"coefficients of shape \(4,\) given; expected \(5,\), one per term"
    ):
        with_coefficients(model, [1, 2, 3, 4])


def test_drawn_models_have_the_model_s_mean_and_covariance():
    model = paper_model(relative_error=0.02)
    correlated = np.array(model.covariance)
    correlated[0, 2] = correlated[2, 0] = -0.9 * np.sqrt(correlated[0, 0] * correlated[2, 2])
    model = with_coefficients(model, model.coefficients, correlated)
    drawn = np.array([one.coefficients for one in draw_models(model, 4000, np.random.default_rng(1))])
    # Seed 1. Four standard errors of a mean, and of a standard deviation, of 4000 draws.
    np.testing.assert_array_less(
        np.abs(drawn.mean(0) - model.coefficients), 4 * model.standard_errors / 4000**0.5
    )
    np.testing.assert_allclose(drawn.std(0), model.standard_errors, rtol=4 / 8000**0.5)
    assert np.corrcoef(drawn[:, 0], drawn[:, 2])[0, 1] == pytest.approx(-0.9, abs=0.02)


def test_drawn_friction_is_never_negative():
    model = paper_model()
    wide = with_coefficients(model, model.coefficients, np.diag([0, 0, 0, 0, 9.0]))
    drawn = [one["coulomb_friction"].coefficient for one in draw_models(wide, 200, np.random.default_rng(0))]
    assert min(drawn) == 0.0 and max(drawn) > 5
