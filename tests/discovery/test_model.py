"""A discovered model: exact JSON, moment of its terms, equation."""

import json

import numpy as np
import pytest

from sindyjoint import JointModel
from sindyjoint.errors import InputError, UnknownNameError

THIRD = 1 / 3


def test_json_is_exact_and_goes_round(found):
    text = found.model.to_json()
    again = JointModel.from_json(text)
    assert again == found.model and again.to_json() == text
    np.testing.assert_array_equal(again.coefficients, found.model.coefficients)
    np.testing.assert_array_equal(
        again.moment([THIRD * 1e-3], [0.01]), found.model.moment([THIRD * 1e-3], [0.01])
    )


def test_json_is_plain(found):
    data = json.loads(found.model.to_json())
    assert data["schema"] == 2 and data["kind"] == "JointModel"
    assert [term["id"] for term in data["terms"]] == list(found.model.ids)


def test_moment_is_the_sum_of_its_terms(found):
    angle, rate = np.array([[1e-4, -5e-4], [0.0, 7e-4]]), np.array([[0.01, -0.02], [0.0, 0.003]])
    k1, k2, k3, c1, friction = found.model.coefficients
    expected = k1 * angle + k2 * angle**2 + k3 * angle**3 + c1 * rate + friction * np.sign(rate)
    np.testing.assert_allclose(found.model.moment(angle, rate), expected, rtol=1e-13)
    assert found.model.moment(1e-4, 0.01).shape == ()


def test_intervals_are_student_t_about_the_coefficient(found):
    for term in found.model.terms:
        low, high = term.interval95
        assert (low + high) / 2 == pytest.approx(term.coefficient)
        assert 1.96 < (high - low) / 2 / term.standard_error < 2.05
    np.testing.assert_allclose(np.sqrt(np.diag(found.model.covariance)), found.model.standard_errors)


def test_terms_by_name(found):
    assert found.model["cubic_stiffness"].symbol == "k3" and "cubic_stiffness" in found.model
    with pytest.raises(UnknownNameError, match="the model has no term 'k9'; it has linear_stiffness"):
        found.model["k9"]


def test_equation_names_every_coefficient(found):
    text = found.model.equation()
    assert text.startswith("M = I·θ̈ + k1·θ") and all(symbol in text for symbol in ("k2", "k3", "c1", "M_F"))
    assert found.model.latex().startswith("M = I")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("terms"), "expected 'schema': 2 .or 1. and 'terms'"),
        (lambda d: d.update(schema=3), "'schema': 2"),
        (lambda d: d["terms"][0].pop("formula"), "not a joint model"),
        (lambda d: d["terms"][0].update(colour="red"), "not a joint model"),
        (lambda d: d["fitted"].pop("samples"), "not a joint model: fitted: key 'samples' is missing"),
        (lambda d: d["terms"].extend(d["terms"] * 40), "not a joint model: 205 terms; expected at most 200"),
    ],
)
def test_what_is_no_model_is_refused(found, change, message):
    data = json.loads(found.model.to_json())
    change(data)
    with pytest.raises(InputError, match=message):
        JointModel.from_dict(data)
    with pytest.raises(InputError, match="the text is not JSON"):
        JointModel.from_json("{")
