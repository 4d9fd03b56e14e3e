"""The rates of a law's states, without its moment."""

import numpy as np
import sympy

from sindyjoint.mechanics import INTER_PANEL
from sindyjoint.mechanics.kernels import integrate_states
from sindyjoint.mechanics.laws import FormulaLaw, LawWithNumbers, SumLaw, as_compiled


def test_the_states_alone_are_those_of_the_whole_law():
    theta, omega, k, y, z, q = sympy.symbols("theta omega k y z q", real=True)
    dahl = FormulaLaw(k * theta * z, {"k": 3.0, "y": 0.1}, {"z": omega - z * sympy.Abs(omega) / y})
    linear = FormulaLaw(k * q + theta**3, {"k": 3.0, "y": 0.2}, {"q": omega - q / y})
    time = np.arange(500) / 500.0
    motion = 0.3 * np.sin(20 * time), 6.0 * np.cos(20 * time)
    for law in (
        dahl,
        SumLaw(INTER_PANEL, dahl),
        SumLaw(SumLaw(linear, INTER_PANEL), dahl),
        LawWithNumbers(SumLaw(INTER_PANEL, dahl), np.array([1.0, 0, 0, 0, 0, 5.0, 0.05]), 0.02),
    ):
        whole = as_compiled(law)
        # Less to do: no moment is worked out, nor a law without states asked.
        assert whole.of_states().numbers.size < whole.numbers.size
        states = np.zeros((2, law.n_states, time.size))
        for compiled, state in zip((whole, whole.of_states()), states, strict=True):
            integrate_states(compiled.address, *motion, compiled.numbers, 2e-3, 3, state)
        np.testing.assert_array_equal(*states)
        assert states.any(axis=2).all()
