"""Compiled formulas against NumPy written out, and the units of formulas, the radian being one of them."""

import pickle

import numpy as np
import pytest

from sindyjoint.equation.dimensions import (
    coefficient_unit,
    formula_unit,
    is_coherent,
    parse_unit,
    same_dimension,
    to_si,
    unit_for,
    unit_text,
)
from sindyjoint.equation.evaluation import BLOCK
from sindyjoint.equation.formula import compile_terms, parse_formula, state_symbol
from sindyjoint.errors import FormulaError, InputError, UnitError

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


@pytest.mark.parametrize("n", [1, 7, BLOCK, BLOCK + 1, 3 * BLOCK + 7])
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
