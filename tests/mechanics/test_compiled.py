"""Compiled laws: translated once and kept on disk; their internal states alone."""

import os
import subprocess
import sys
from textwrap import indent

import numpy as np
import pytest
import sympy

from sindyjoint.mechanics import INTER_PANEL
from sindyjoint.mechanics.kernels import integrate_states
from sindyjoint.mechanics.laws import FormulaLaw, LawWithNumbers, SumLaw, as_compiled

JOINT = """
from sindyjoint.mechanics.excitation import harmonic
from sindyjoint.mechanics.laws import INTER_PANEL
from sindyjoint.mechanics.stickslip import simulate
simulate(INTER_PANEL, harmonic(5.0, 4.0), 1.0, 1000.0)
"""
FORMULA = """
import sympy
from sindyjoint.mechanics.excitation import harmonic
from sindyjoint.mechanics.laws import FormulaLaw
from sindyjoint.mechanics.stickslip import simulate
theta, omega, k, c = sympy.symbols("theta omega k c")
law = FormulaLaw({formula}, {{"k": 6000.0, "c": 10.0}}, inertia=0.02)
simulate(law, harmonic(5.0, 4.0), 1.0, 1000.0)
"""
RIG = "from sindyjoint.mechanics.rigs import load_rig\nload_rig('pulse-rig').respond(duration=0.5)\n"
COUNTED = """
from numba.core import event
with event.install_recorder("numba:compile") as translated:
{code}
print(len(translated.buffer))
"""


def translations(code, cache):
    """Return how many functions numba translates in a new process: work is counted, and not its time."""
    text = COUNTED.format(code=indent(code, "    "))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, env=environment, check=True
    )
    return int(done.stdout)


@pytest.mark.slow
def test_the_first_use_of_a_rig_translates_and_later_ones_do_not(tmp_path):
    assert translations(RIG, tmp_path) > 0
    assert translations(RIG, tmp_path) == 0


def test_a_first_formula_translates_and_a_later_one_of_any_kind_does_not(tmp_path):
    assert translations(JOINT + FORMULA.format(formula="k * theta + c * omega"), tmp_path) > 0
    assert translations(FORMULA.format(formula="k * theta + c * omega * sympy.Abs(omega)"), tmp_path) == 0


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
