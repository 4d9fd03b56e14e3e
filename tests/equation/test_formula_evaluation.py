"""Compiled formulas against NumPy written out, their units, the radian being one, and elements along a motion."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import JointModel
from sindyjoint.equation import (
    ElementState,
    JointElement,
    Value,
    coefficient_unit,
    compile_terms,
    formula_unit,
    is_coherent,
    parse_formula,
    parse_unit,
    same_dimension,
    state_symbol,
    to_si,
    unit_for,
    unit_text,
)
from sindyjoint.errors import FormulaError, InputError, SindyJointError, UnitError
from tests.made_models import paper_model

TEXTS = [
    "theta",
    "theta**2",
    "theta**3",
    "theta**5",
    "theta**2*omega",
    "omega*abs(omega)",
    "1",
    "sign(omega)",
]


def by_hand(theta, omega):
    columns = [theta, theta**2, theta**3, theta**5, theta**2 * omega, omega * np.abs(omega), 1 + 0 * theta]
    return np.stack([*columns, np.sign(omega)], axis=1)


def compiled(texts, arguments=("theta", "omega", "alpha"), parameters=()):
    return compile_terms([parse_formula(text, parameters) for text in texts], arguments)


@pytest.mark.parametrize("n", [1, 7, 4096, 4097, 3 * 4096 + 7])
def test_blocks_do_not_show(n):
    generator = np.random.default_rng(3)
    theta, omega = generator.normal(size=(2, n))
    columns = compiled(TEXTS)(theta, omega, 0.0)
    assert columns.shape == (n, len(TEXTS))
    assert columns.flags.f_contiguous and columns.dtype == np.float64
    # One unit in the last place per multiplication; theta**5 has four.
    np.testing.assert_allclose(columns, by_hand(theta, omega), rtol=1e-15)


def test_powers_are_shared():
    # theta^2, theta^3, theta^4, theta^5: one product each.
    operations = compiled(["theta**2", "theta**3", "theta**4", "theta**5"]).operations
    assert [name for name, _, _ in operations] == ["multiply"] * 4


def test_equal_pieces_are_worked_out_once():
    operations = compiled(
        ["abs(omega)*theta", "abs(omega)*theta*omega**2", "sqrt(1 + abs(omega))"]
    ).operations
    assert sum(name == "abs" for name, _, _ in operations) == 1


def test_arguments_may_be_scalars():
    function = compiled(["g*theta"], ["theta", "g"], ["g"])
    np.testing.assert_array_equal(function([1.0, 2.0], 3.0), [[3.0], [6.0]])
    np.testing.assert_array_equal(function(1.0, 3.0), [[3.0]])


def test_lists_integers_and_strided_arrays_are_welcome_and_left_alone():
    both = np.arange(12.0).reshape(6, 2)
    kept = both.copy()
    columns = compiled(["theta*omega"])(both[:, 0], both[:, 1], 0)
    np.testing.assert_array_equal(columns[:, 0], kept[:, 0] * kept[:, 1])
    np.testing.assert_array_equal(both, kept)
    np.testing.assert_array_equal(compiled(["theta**2"])([1, 2], [0, 0], 0), [[1.0], [4.0]])


def test_a_compiled_set_can_be_pickled():
    function = compiled(TEXTS)
    again = pickle.loads(pickle.dumps(function))
    assert again == function
    np.testing.assert_array_equal(again(0.3, -0.4, 0.0), function(0.3, -0.4, 0.0))


def test_compiling_twice_costs_once():
    assert compiled(TEXTS) is compiled(TEXTS)


def test_the_order_of_terms_is_the_order_of_columns():
    generator = np.random.default_rng(5)
    theta, omega = generator.normal(size=(2, 50))
    order = generator.permutation(len(TEXTS))
    shuffled = compiled([TEXTS[i] for i in order])(theta, omega, 0.0)
    np.testing.assert_array_equal(shuffled, compiled(TEXTS)(theta, omega, 0.0)[:, order])


def test_overflow_gives_infinity_in_silence():
    # Warnings are errors here, so a RuntimeWarning would fail the test.
    assert compiled(["exp(theta)"])(1e4, 0.0, 0.0)[0, 0] == np.inf


def test_no_terms_give_no_columns():
    assert compiled([])([1.0, 2.0], [0.0, 0.0], 0.0).shape == (2, 0)


def test_a_wrong_number_of_arrays_is_refused():
    with pytest.raises(InputError, match=r"2 arrays given; expected 3 \(theta, omega, alpha\)"):
        compiled(TEXTS)([1.0], [1.0])


def test_unequal_lengths_are_refused_with_the_shapes():
    with pytest.raises(
        InputError, match=r"theta \(2,\), omega \(3,\), alpha \(\) given; expected one-dimensional"
    ):
        compiled(TEXTS)([1.0, 2.0], [1.0, 2.0, 3.0], 0.0)
    with pytest.raises(InputError, match=r"theta \(1, 2\)"):
        compiled(TEXTS)([[1.0, 2.0]], [1.0, 2.0], 0.0)


def test_a_symbol_without_a_value_is_refused():
    with pytest.raises(FormulaError, match="the formula holds g, which has no value; known are theta, omega"):
        compiled(["g*theta"], ["theta", "omega"], ["g"])


def test_an_expression_from_elsewhere_is_refused():
    import sympy

    with pytest.raises(FormulaError, match="gamma.*cannot be evaluated: gamma is no allowed function"):
        compile_terms([sympy.gamma(state_symbol("z"))], ["z"])


UNITS = {
    "theta": "rad",
    "omega": "rad/s",
    "alpha": "rad/s^2",
    "g": "rad",
    "v_s": "rad/s",
    "n": "1",
    "M_y": "N*m",
}
PARAMETERS = ("g", "v_s", "n", "M_y")


def unit_of(text):
    return unit_text(formula_unit(parse_formula(text, PARAMETERS), UNITS))


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("1", "1"),
        ("2.5*pi", "1"),
        ("theta", "rad"),
        ("theta**2*omega", "rad^3/s"),
        ("omega*abs(omega)", "rad^2/s^2"),
        ("sign(omega)", "1"),
        ("heaviside(theta)*alpha", "rad/s^2"),
        ("exp(-(abs(omega)/v_s)**n)*sign(omega)", "1"),
        ("sign(theta)*max(abs(theta) - g, 0)", "rad"),
        ("sqrt(theta**2 + g**2)", "rad"),
        ("abs(omega)**0.5", "rad^0.5/s^0.5"),
        ("tanh(theta/g) + atan(omega/v_s) + log(1 + abs(theta)/g)", "1"),
        ("sin(theta) + cos(1)*tan(theta/g)", "1"),
        ("M_y*theta/g", "N*m"),
        ("min(theta, g)", "rad"),
    ],
)
def test_unit_of_a_formula(text, unit):
    assert unit_of(text) == unit


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "theta + omega",
            "omega \\+ theta combines omega in rad/s with theta in rad; expected equal units",
        ),
        ("theta - 0.001", "with theta in rad; expected equal units"),
        ("max(theta, omega)", "max\\(omega, theta\\) combines"),
        ("tanh(theta)", "tanh\\(theta\\) is given rad; expected a plain number: divide by a parameter"),
        ("exp(-abs(omega))", "exp\\(-abs\\(omega\\)\\) is given rad/s; expected a plain number"),
        ("cos(omega)", "cos\\(omega\\) is given rad/s"),
        ("abs(theta)**n", "the base of abs\\(theta\\)\\*\\*n has the unit rad; with a parameter as exponent"),
        ("(abs(theta)/g)**v_s", "the exponent of .* has the unit rad/s"),
    ],
)
def test_what_does_not_fit_together_is_refused(text, message):
    with pytest.raises(UnitError, match=message):
        unit_of(text)


def test_a_symbol_without_a_unit_is_refused():
    with pytest.raises(FormulaError, match="the formula holds n, whose unit is not known"):
        formula_unit(parse_formula("n*theta", ["n"]), {"theta": "rad"})


def test_the_radian_counts():
    assert not same_dimension("N*m/rad", "N*m/rad^2")
    assert not same_dimension("N*m/rad", "N*m")
    assert same_dimension("N*m*s/rad", "s*m*N/rad")


@pytest.mark.parametrize(
    ("text", "rotation", "translation"),
    [
        ("1", "N*m", "N"),
        ("theta", "N*m/rad", "N/m"),
        ("theta**3", "N*m/rad^3", "N/m^3"),
        ("omega", "N*m*s/rad", "N*s/m"),
        ("omega*abs(omega)", "N*m*s^2/rad^2", "N*s^2/m^2"),
        ("alpha", "kg*m^2", "kg"),
        ("sign(omega)", "N*m", "N"),
    ],
)
def test_unit_of_the_coefficient(text, rotation, translation):
    expression = parse_formula(text)
    assert coefficient_unit(expression, {}, "rotation") == rotation
    assert coefficient_unit(expression, {}, "translation") == translation
    # and the one follows from the other by itself, in both directions
    assert unit_for(rotation, "translation") == translation
    assert unit_for(translation, "rotation") == rotation


@pytest.mark.parametrize(
    ("rotation", "translation"), [("rad", "m"), ("rad/s", "m/s"), ("1", "1"), ("s", "s")]
)
def test_units_of_parameters_translate_too(rotation, translation):
    assert unit_for(rotation, "translation") == translation
    assert unit_for(translation, "rotation") == rotation


def test_prefixes_are_known_so_that_they_can_be_refused_kindly():
    assert to_si(1.0, "mN*m") == pytest.approx(1e-3)
    assert to_si(180.0, "deg") == pytest.approx(3.141592653589793)
    assert is_coherent("N*m*s/rad") and is_coherent("kg*m^2") and is_coherent("1")
    assert not is_coherent("mrad") and not is_coherent("N*mm") and not is_coherent("g")


@pytest.mark.parametrize("text", ["", " ", None, 3, "N·m", "N*m; import os", "m" * 70, "$"])
def test_what_is_no_unit_text_is_refused(text):
    with pytest.raises(UnitError, match="expected a text such as 'N\\*m/rad', or '1' for a plain number"):
        parse_unit(text)


@pytest.mark.parametrize("text", ["furlong", "2*N", "N**", "N m)", "1/0", "--"])
def test_a_unit_that_cannot_be_read_is_refused(text):
    with pytest.raises(UnitError, match="cannot be read .*known are m, kg, s, rad, N, Hz, deg, K"):
        parse_unit(text)


@pytest.mark.parametrize("text", ["10**10**10", "9^9^9^9", "m**9**9**9", "m^(9)^9", "m^999", "(m^99)^99"])
def test_a_tower_of_powers_is_refused_before_it_is_worked_out(text):
    with pytest.raises(UnitError, match="powers up to 99"):
        parse_unit(text)


@pytest.mark.parametrize("text", ["1", "1/s", "N*m*s^2/rad^2", "kg*m**2", "m^-1.5", "N*m/rad^(2)"])
def test_units_of_catalogues_still_pass(text):
    assert parse_unit(text) is not None


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
        (lambda d: d["terms"][0].update(coefficient="5"), "terms.1.coefficient: expected a number, not '5'"),
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
            "elements.1.parameters.1: key 'value' is missing",
        ),
        (lambda d: d.update(more=1), "unknown key 'more'"),
        (lambda d: d.update(schema=3), "'schema': 2"),
    ],
)
def test_a_tampered_model_is_refused_with_the_place(change, words):
    with pytest.raises(SindyJointError) as error:
        JointModel.from_dict(tampered(change))
    assert words in str(error.value) and "\n" not in str(error.value)
