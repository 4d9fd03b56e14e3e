"""A discovery and its refinement that disagree: a warning on top."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import discover
from sindyjoint.judgement.discovery import refined
from sindyjoint.mechanics import virtual_campaign
from sindyjoint.response import with_coefficients


@pytest.fixture(scope="module")
def found():
    campaign = virtual_campaign(frequencies=[3, 6], levels=[0.8, 0.4], duration=2.0, random_state=6)
    return discover(campaign, "paper", correct=False)


def disagreement(result):
    return [line for line in refined(result).warnings if "disagree by more than 3 standard errors" in line]


def test_regression_and_response_that_agree_are_no_warning(found):
    assert disagreement(found) == []


def test_a_coefficient_that_the_response_moves_out_of_its_errors_is_named_with_both_values(found):
    """As where derivatives at few samples per period leave cubic stiffness a tenth too small."""
    numbers, errors = found.model.coefficients, found.model.standard_errors
    place = found.model.ids.index("cubic_stiffness")
    numbers[place] *= 0.85
    model = with_coefficients(found.model, numbers, np.diag(errors**2))
    (line,) = disagreement(replace(found, model=model))
    assert f"cubic stiffness ({numbers[place]:.4g} ± {errors[place]:.2g} by regression, " in line
    assert "on the response)" in line and "the model lacks something" in line
