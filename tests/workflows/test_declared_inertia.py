"""The declared inertia is asked where a law has more than the paper's terms: truth is the simulated joint's."""

from dataclasses import replace

import pytest

from sindyjoint import PaperLaw, discover, simulate, verify
from tests.diagnosis.hidden_effects import hide


@pytest.fixture(scope="module")
def heavy():
    joint = PaperLaw(k1=5000.0, c1=30.0, M_F=1.0, inertia=0.4)
    return simulate(
        joint, frequencies=[3, 5, 7], levels=[0.9, 0.6, 0.4], angle_limit=1e-3, duration=6, rng=702
    )


def declared(campaign, inertia):
    return replace(campaign, joint=replace(campaign.joint, inertia=inertia))


def said(found):
    return [line for line in found.warnings if "the declared inertia of" in line]


def test_an_inertia_that_is_wrong_by_a_twentieth_is_found_and_named(heavy):
    campaign = declared(heavy, 0.42)
    found = discover(campaign)
    assert found.model.ids == ("linear_stiffness", "linear_damping", "coulomb_friction", "inertia")
    truth = {"linear_stiffness": 5000.0, "linear_damping": 30.0, "coulomb_friction": 1.0, "inertia": 0.4}
    for term in found.model.terms:
        # Seed 702, four numbers.
        assert abs(term.coefficient - truth[term.id]) < 3.5 * term.standard_error
    assert "0.42 kg*m^2 is not that of these runs: they give 0.39" in said(found)[0]
    # The campaign that declares the wrong one is judged alike by what was found.
    lights = [
        {light.name: light.colour for light in trust.lights}
        for trust in (found.trust, verify(found.model, campaign).trust)
    ]
    assert lights[0] == lights[1]


def test_a_right_inertia_is_used(heavy):
    found = discover(heavy)
    assert "inertia" not in found.model and not said(found)


@pytest.mark.parametrize(("name", "seed"), [("frequency_dependent_stiffness", 97), ("maxwell_branch", 96)])
def test_what_another_inertia_cannot_be_is_not_taken_for_one(name, seed):
    """A stiffness that rises with the frequency fits with −1.9 kg·m² (seed 97)."""
    found = discover(hide(name, seed).campaign)
    assert "inertia" not in found.model and not said(found)
