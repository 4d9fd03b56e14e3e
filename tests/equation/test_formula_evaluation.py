"""Compiled formulas: shared work, blocks, shapes; checked against NumPy written out."""

import pickle

import numpy as np
import pytest

from sindyjoint.equation.evaluation import BLOCK
from sindyjoint.equation.formula import compile_terms, parse_formula, state_symbol
from sindyjoint.errors import FormulaError, InputError

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
