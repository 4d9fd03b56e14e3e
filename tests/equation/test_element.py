"""Elements of a joint model: closed forms of their moments, their equation, and the file they are kept in."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import JointModel
from sindyjoint.equation.element import ElementState, JointElement, Value
from sindyjoint.errors import InputError, SindyJointError
from tests.made_models import paper_model


def value(name, number, formula="", unit="N*m/rad", error=0.01):
    error *= abs(number)
    return Value(name, number, error, (number - 1.96 * error, number + 1.96 * error), unit, formula)


JENKINS = JointElement(
    "jenkins_element", "jenkins_element", "k_t", "Jenkins element",
    (value("k_t", 3000.0, "z"),), (value("theta_y", 1e-4, unit="rad"),),
    (ElementState("z", "rad", "omega", "theta_y"),),
)  # fmt: skip
MAXWELL = JointElement(
    "maxwell_branch", "maxwell_branch", "k_m", "Maxwell branch",
    (value("k_m", 500.0, "q"),), (value("tau", 0.05, unit="s"),), (ElementState("q", "rad", "omega - q/tau"),),
)  # fmt: skip


def with_elements(*elements):
    model = paper_model()
    size = len(model.terms) + sum(len(element.numbers) for element in elements)
    whole = replace(model, elements=elements)
    errors = whole.number_errors
    assert errors.size == size
    return whole.with_numbers(whole.numbers, np.diag(errors**2))


def test_a_slider_follows_its_closed_form():
    # Up by 3 yield angles, down by 5: sticks over the first, slips at ±k·θ_y, sticks over two after the reversal.
    path = np.concatenate([np.linspace(0, 3e-4, 3001), np.linspace(3e-4, -2e-4, 5001)[1:]])
    moment = JENKINS.along(path, np.gradient(path, 1e-4), 1e-4)
    down = np.clip(1e-4 - (3e-4 - path[3001:]), -1e-4, 1e-4)
    expected = 3000.0 * np.concatenate([np.minimum(path[:3001], 1e-4), down])
    # Half a step of the motion at the corner: 3000·1e-7/2.
    assert np.abs(moment - expected).max() < 2e-4


def test_a_maxwell_branch_has_its_complex_stiffness():
    w, tau, amplitude = 2 * np.pi * 4.0, 0.05, 1e-3
    time = np.arange(0, 3, 1e-4)
    moment = MAXWELL.along(amplitude * np.sin(w * time), amplitude * w * np.cos(w * time), 1e-4)[-5000:]
    basis = np.column_stack([np.sin(w * time), np.cos(w * time)])[-5000:]
    found = np.linalg.lstsq(basis, moment, rcond=None)[0] / (500.0 * amplitude)
    ratio = (w * tau) ** 2 / (1 + (w * tau) ** 2)
    assert found == pytest.approx([ratio, ratio / (w * tau)], rel=1e-5)


def test_the_moment_of_a_model_with_elements_needs_a_motion():
    model = with_elements(JENKINS)
    time = np.arange(0, 1, 1e-3)
    angle, rate = 5e-4 * np.sin(6 * time), 3e-3 * np.cos(6 * time)
    with pytest.raises(InputError, match="jenkins_element depends on the motion before.*step"):
        model.moment(angle, rate)
    whole = model.moment(angle, rate, 1e-3)
    assert whole == pytest.approx(
        model.without_elements().moment(angle, rate) + JENKINS.along(angle, rate, 1e-3), rel=1e-12
    )
    with pytest.warns(UserWarning, match=r"angle up to 0.001 rad where 0.0008.* % of the time"):
        model.moment(2 * angle, 2 * rate, 1e-3)


def test_the_equation_names_states_apart_and_gives_their_rates():
    other = replace(JENKINS, id="second", columns=(value("k_u", 10.0, "z"),))
    text = with_elements(JENKINS, other, MAXWELL).equation()
    assert "k_t·z1 + k_u·z2 + k_m·q" in text
    assert "dz1/dt = θ̇ with |z1| ≤ theta_y" in text and "dq/dt = θ̇ - q/tau" in text
    latex = with_elements(JENKINS).latex()
    assert r"k_{t}\,z" in latex and r"\dot{z} = \dot{\theta},\ |z| \leq \theta_{y}" in latex


def test_a_model_with_elements_is_read_back_to_the_last_bit():
    model = with_elements(JENKINS, MAXWELL)
    data = json.loads(model.to_json())
    assert data["schema"] == 2 and [e["id"] for e in data["elements"]] == [
        "jenkins_element",
        "maxwell_branch",
    ]
    assert set(data["elements"][0]) >= {"id", "effect", "symbol", "columns", "parameters", "states"}
    assert len(data["covariance"]) == 9
    assert JointModel.from_json(model.to_json()) == model


def test_a_model_of_the_first_schema_still_loads():
    data = paper_model().to_dict()
    del data["elements"], data["fitted"]["data"], data["fitted"]["versions"]
    data["schema"] = 1
    assert JointModel.from_dict(data) == paper_model()


def tampered(change):
    data = json.loads(with_elements(JENKINS).to_json())
    change(data)
    return data


@pytest.mark.parametrize(
    "change, words",
    [
        (lambda d: d["terms"][0].update(coefficient="5"), "terms.1.coefficient is '5'"),
        (lambda d: d["terms"][0].update(coefficient=None), "terms.1.coefficient"),
        (lambda d: d["terms"][0].update(coefficient=float("nan")), "terms.1.coefficient"),
        (lambda d: d["terms"][0].update(coefficient=10**400), "terms.1.coefficient"),
        (lambda d: d["terms"].append(d["terms"][0]), "'linear_stiffness' is used twice"),
        (lambda d: d["covariance"].pop(), "covariance has 6 row"),
        (lambda d: d["covariance"][0].__setitem__(0, -1.0), "a variance is negative"),
        (lambda d: d["elements"][0]["states"][0].update(rate="__import__('os')"), "not allowed"),
        (lambda d: d["elements"][0]["columns"][0].update(formula="z*w"), "w"),
        (lambda d: d["elements"][0].update(columns=[]), "elements.1.columns"),
        (
            lambda d: d["elements"][0]["parameters"][0].pop("value"),
            "elements.1.parameters.1.value is missing",
        ),
        (lambda d: d.update(more=1), "more is unknown"),
        (lambda d: d.update(schema=3), "'schema': 2"),
    ],
)
def test_a_tampered_model_is_refused_with_the_place(change, words):
    with pytest.raises(SindyJointError) as error:
        JointModel.from_dict(tampered(change))
    assert words in str(error.value) and "\n" not in str(error.value)
