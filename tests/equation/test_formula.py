"""The parser of formulas: what it accepts means what it says, and nothing else gets through."""

import time

import numpy as np
import pytest

from sindyjoint.equation import (
    FUNCTIONS,
    compile_terms,
    formula_latex,
    formula_pretty,
    formula_text,
    parameter_symbol,
    parse_formula,
    state_symbol,
    variable_symbols,
)
from sindyjoint.errors import FormulaError

GRID = np.array([-1.7, -0.6, -0.0, 0.0, 0.3, 1.0, 1.9])
THETA, OMEGA = (grid.ravel() for grid in np.meshgrid(GRID, GRID))
ALPHA = np.linspace(-2.0, 2.0, THETA.size)

MEANINGS = {
    "theta": lambda t, w, a: t,
    "-theta": lambda t, w, a: -t,
    "+theta": lambda t, w, a: t,
    "theta - omega - alpha": lambda t, w, a: t - w - a,
    "theta**2*omega": lambda t, w, a: t * t * w,
    "-theta**2": lambda t, w, a: -(t * t),
    "2**3**2*theta": lambda t, w, a: 512 * t,
    "theta**2.0": lambda t, w, a: t * t,
    "abs(theta)**0.5": lambda t, w, a: np.sqrt(np.abs(t)),
    "1/(1 + theta**2)": lambda t, w, a: 1 / (1 + t * t),
    "(1 + omega**2)**-2": lambda t, w, a: (1 + w * w) ** -2.0,
    "x*v + a": lambda t, w, a: t * w + a,
    "1": lambda t, w, a: np.ones_like(t),
    "2.5e-3*pi": lambda t, w, a: np.full_like(t, 2.5e-3 * np.pi),
    "sign(omega)": lambda t, w, a: np.sign(w),
    "heaviside(omega)": lambda t, w, a: np.where(w > 0, 1.0, np.where(w < 0, 0.0, 0.5)),
    "abs(theta)": lambda t, w, a: np.abs(t),
    "sqrt(theta**2 + omega**2)": lambda t, w, a: np.hypot(t, w),
    "exp(-abs(omega))": lambda t, w, a: np.exp(-np.abs(w)),
    "log(1 + theta**2)": lambda t, w, a: np.log1p(t * t),
    "theta*abs(omega)**(1/3)": lambda t, w, a: t * np.cbrt(np.abs(w)),
    "sin(theta) + cos(omega) + tan(theta/4)": lambda t, w, a: np.sin(t) + np.cos(w) + np.tan(t / 4),
    "tanh(omega) - atan(theta)": lambda t, w, a: np.tanh(w) - np.arctan(t),
    "max(theta, 0)": lambda t, w, a: np.maximum(t, 0),
    "min(theta, omega, 0.5)": lambda t, w, a: np.minimum(np.minimum(t, w), 0.5),
    "max(min(theta, 1), -1)": lambda t, w, a: np.clip(t, -1, 1),
    " theta\n * omega ": lambda t, w, a: t * w,
}


@pytest.mark.parametrize("text", MEANINGS)
def test_a_formula_means_what_it_says(text):
    values = compile_terms([parse_formula(text)])(THETA, OMEGA, ALPHA)[:, 0]
    np.testing.assert_allclose(values, MEANINGS[text](THETA, OMEGA, ALPHA), rtol=1e-14, atol=1e-15)


def test_every_function_has_a_meaning_above():
    assert all(any(f"{name}(" in text for text in MEANINGS) for name in FUNCTIONS)


def test_friction_is_zero_at_rest():
    value = compile_terms([parse_formula("sign(omega)")])([0.0, 0.0], [0.0, -0.0], 0.0)
    assert np.array_equal(value, [[0.0], [0.0]])


REFUSED = {
    "": "it is empty",
    "   ": "it is empty",
    "__import__('os').system('true')": """the character "'" (a text) is not allowed""",
    "__import__(theta)": "a call of '__import__' is not allowed",
    "eval(theta)": "a call of 'eval' is not allowed",
    "theta.real": "'theta.real' (attribute access) is not allowed",
    "theta.__class__": "'theta.__class__' (attribute access) is not allowed",
    "exp.__globals__": "'exp.__globals__' (attribute access) is not allowed",
    "(theta).conjugate()": "a call of 'theta.conjugate' is not allowed",
    "theta[0]": "the character '[' (indexing) is not allowed",
    "lambda: theta": "(a lambda or an assignment) is not allowed",
    "(x := 1)": "(a lambda or an assignment) is not allowed",
    "theta > 1": "the character '>' (a comparison; heaviside, min and max switch) is not allowed",
    "theta == 1": "(a comparison or an assignment) is not allowed",
    "theta is omega": "'theta is omega' (a comparison) is not allowed",
    "theta and omega": "'theta and omega' (a logical operation) is not allowed",
    "not theta": "'not theta' (this operation) is not allowed",
    "theta if omega else 1": "'theta if omega else 1' (a condition) is not allowed",
    "theta, omega": "'(theta, omega)' (a list of values) is not allowed",
    "theta // 2": "'theta // 2' (this operation) is not allowed",
    "theta % 2": "the character '%' is not allowed",
    "theta^2": "the character '^' (powers are written **) is not allowed",
    "theta·omega": "the character '·' (products are written *) is not allowed",
    "ｔheta": "the character 'ｔ' is not allowed",
    "theta\x00": r"the character '\x00' is not allowed",
    "theta theta": "it is not an expression (invalid syntax",
    "theta +": "it is not an expression (invalid syntax",
    "(theta": "it is not an expression ('(' was never closed",
    "1if theta else 2": "it is not an expression (invalid decimal literal",
    "0777": "it is not an expression (leading zeros",
    "max(*theta, 1)": "'*theta' (an unpacking) is not allowed",
    "exp(theta, **omega)": "'exp(theta, **omega)' (an unpacking) is not allowed",
    "thetta": "the name 'thetta' is unknown (did you mean theta?)",
    "g*theta": "the name 'g' is unknown",
    "sine(theta)": "a call of 'sine' is not allowed (did you mean sin?)",
    "theta(omega)": "a call of 'theta' is not allowed",
    "sign": "the function sign stands without its argument",
    "sign()": "sign takes one argument, 0 given",
    "sign(theta, omega)": "sign takes one argument, 2 given",
    "max(theta)": "max takes two to 4 arguments, 1 given",
    "min(1, 2, 3, 4, theta)": "min takes two to 4 arguments, 5 given",
    "True": "True is not a real number",
    "None": "None is not a real number",
    "1j*theta": "1j is not a real number",
    "1e999": "a number in it is beyond 1e+30",
    "1" * 60 + "*theta": "a number in it is beyond 1e+30",
    "1/0": "'1 / 0' is not real and finite for every motion; divide by, and take roots",
    "theta/(omega - omega)": "'theta / (omega - omega)' is not real and finite",
    "0**-1*theta": "'0 ** (-1)' is not real and finite",
    "omega/theta": "'omega / theta' is not real and finite",
    "1/(1 - abs(theta))": "is not real and finite for every motion",
    "abs(theta)**-0.5": "is not real and finite for every motion",
    "sqrt(theta)": "'sqrt(theta)' is not real and finite",
    "theta**0.5": "'theta ** 0.5' is not real and finite",
    "log(abs(theta))": "'log(abs(theta))' is not real and finite",
    "sqrt(-1)": "'sqrt(-1)' has no finite value",
    "log(0)*theta": "'log(0)' has no finite value",
    "exp(1000)": "'exp(1000)' has no finite value",
    "(-8)**(1/3)*theta": "'(-8) ** (1 / 3)' is not real and finite",
    "(-theta**2)**0.5": "is not real and finite",
    "theta**13": "the exponent of 'theta ** 13' is beyond 12",
    "theta**-13": "the exponent of 'theta ** (-13)' is beyond 12",
    "theta**1e9": "is beyond 12",
    "theta**omega": "the exponent of 'theta ** omega' is not a number",
    "2**theta": "the exponent of '2 ** theta' is not a number",
    "(theta**12)**12": "its power theta**144 is beyond 12",
    "theta**12*theta**12": "its power theta**24 is beyond 12",
    "9**9**9": "is beyond 12",
    "(2**12)**12*theta": "is beyond 1e+30",
    "10**12*10**12*10**12*theta": "is beyond 1e+30",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_outside_the_list_is_refused_with_the_piece_shown(text):
    with pytest.raises(FormulaError) as caught:
        parse_formula(text)
    message = str(caught.value)
    assert message.startswith("formula ")
    assert REFUSED[text] in message
    assert message.endswith(f"and the functions {', '.join(FUNCTIONS)}")
    assert "\n" not in message


BOMBS = [
    "(" * 180 + "theta" + ")" * 180,
    "-" * 390 + "theta",
    "theta" + "+theta*omega" * 30,
    "exp(exp(exp(exp(exp(exp(exp(9)))))))",
    "exp(" * 20 + "theta" + ")" * 20,
    "max(exp(theta),exp(omega)," * 9 + "1" + ")" * 9,
    "+".join(f"abs(theta-0.{i})" for i in range(1, 19)),
    "((((((theta+1)**12+1)**12+1)**12+1)**12+1)**12+1)**12",
    "((((((9**9)**9)**9)**9)**9)**9)",
    "theta**(12**(12**(12**12)))",
    "tan(" * 11 + "abs(theta)**0.37" + ")" * 11,
    "heaviside(" * 11 + "theta-omega" + ")" * 11,
    # sympy itself works for minutes on these two: it cannot tell whether the logarithm is real.
    "tanh(tanh(sin(exp(log(alpha)**0.5))**12)**0.5)",
    "tan(heaviside(sin(atan(tanh(exp((log(log(max(theta, pi))) + 1)**12))))**12))",
]


@pytest.mark.parametrize("text", BOMBS)
def test_formulas_that_want_to_cost_time_do_not(text):
    parse_formula("theta")
    start = time.process_time()
    try:
        compile_terms([parse_formula(text)])(THETA, OMEGA, ALPHA)
    except FormulaError:
        pass
    # Milliseconds on a quiet machine; a tower of powers worked out in full would take hours.
    assert time.process_time() - start < 5.0


def test_too_long_a_text_is_refused_before_it_is_read():
    with pytest.raises(FormulaError, match="it has 605 characters, more than 400"):
        parse_formula("(" * 300 + "theta" + ")" * 300)


def _largest_of(text):
    return f"max({text},{text},{text},{text})"


def test_depth_and_size_are_bounded():
    with pytest.raises(FormulaError, match="it is nested deeper than 20 levels"):
        parse_formula("-" * 30 + "theta")
    with pytest.raises(FormulaError, match="it has more than 80 parts"):
        parse_formula(_largest_of(_largest_of(_largest_of("-x"))))


@pytest.mark.parametrize("given", [None, 3, b"theta", ["theta"]])
def test_what_is_no_text_is_refused(given):
    with pytest.raises(FormulaError, match=f"is a {type(given).__name__}; expected a text"):
        parse_formula(given)


def test_parameters_are_known_only_when_named():
    expression = parse_formula("exp(-(abs(omega)/v_s)**n)*sign(omega)", ["v_s", "n"])
    assert {str(symbol) for symbol in expression.free_symbols} == {"omega", "v_s", "n"}
    with pytest.raises(FormulaError, match=r"the name 'v_s' is unknown.*\(or x, v, a\), n, "):
        parse_formula("exp(-(abs(omega)/v_s)**n)*sign(omega)", ["n"])


@pytest.mark.parametrize("name", ["theta", "x", "pi", "exp", "max"])
def test_a_parameter_cannot_take_a_word_of_the_language(name):
    with pytest.raises(FormulaError, match=f"parameter name '{name}' already means something in a formula"):
        parse_formula("theta", [name])


@pytest.mark.parametrize("name", ["", "2g", "v s", "__class__", "ä", "g" * 40, "f()"])
def test_a_parameter_name_is_a_plain_identifier(name):
    with pytest.raises(FormulaError, match="expected a letter followed by letters, digits or _"):
        parameter_symbol(name)


def test_parameters_are_positive_and_states_are_of_either_sign():
    assert parameter_symbol("g").is_positive
    assert parse_formula("abs(z)*abs(g)", ["g"], states=["z"]) == parse_formula("g*abs(z)", ["g"], ["z"])
    assert state_symbol("z").is_real and not state_symbol("z").is_positive


def test_the_letters_of_translation_are_the_same_variables():
    assert parse_formula("x**2*v + a") == parse_formula("theta**2*omega + alpha")


def test_text_latex_and_line():
    expression = parse_formula("2.5e-7*max(abs(theta) - g, 0)*sign(theta)*omega**2", ["g"])
    assert formula_text(expression) == "2.5e-07*omega**2*sign(theta)*max(0, -g + abs(theta))"
    assert formula_text(expression, "translation") == "2.5e-07*v**2*sign(x)*max(0, -g + abs(x))"
    assert formula_pretty(expression) == "2.5e-07 θ̇² sgn(θ) max(0, |θ| - g)"
    assert formula_pretty(expression, "translation") == "2.5e-07 \u1e8b² sgn(x) max(0, |x| - g)"
    latex = formula_latex(expression)
    assert latex.startswith(r"2.5 \cdot 10^{-7} \dot{\theta}^{2} \operatorname{sign}{\left(\theta \right)}")
    assert latex.endswith(r"\max\left(0, \left|{\theta}\right| - g\right)")
    assert formula_latex(parse_formula("heaviside(theta)*alpha"), "translation") == (
        r"\ddot{x} H{\left(x \right)}"
    )


def test_products_are_written_angle_first():
    assert formula_pretty(parse_formula("alpha*omega*theta")) == "θ θ̇ θ̈"
    assert formula_latex(parse_formula("omega*theta")) == r"\theta \dot{\theta}"


def test_variables_are_real():
    assert all(symbol.is_real for symbol in (*variable_symbols(), parameter_symbol("g")))
