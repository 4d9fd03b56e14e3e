"""A first use translates once, and is kept on disk; a new formula translates nothing."""

import os
import subprocess
import sys
from textwrap import indent

import pytest

JOINT = """
from sindyjoint.mechanics.excitation import harmonic
from sindyjoint.mechanics import INTER_PANEL
from sindyjoint.mechanics.stickslip import simulate
simulate(INTER_PANEL, harmonic(5.0, 4.0), 1.0, 1000.0)
"""
FORMULA = """
import sympy
from sindyjoint.mechanics.excitation import harmonic
from sindyjoint.mechanics import FormulaLaw
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


NEW = "from numba import njit\nassert njit(lambda x: x + 1)(1) == 2\n"


def translations(code, **cache):
    """Return how many functions numba translates in a new process: work is counted, and not its time."""
    text = COUNTED.format(code=indent(code, "    "))
    environment = {**os.environ, **cache, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, env=environment, check=True
    )
    return int(done.stdout)


@pytest.mark.slow
def test_the_first_use_of_a_rig_translates_and_later_ones_do_not(tmp_path):
    cache = {"NUMBA_CACHE_DIR": str(tmp_path)}
    assert translations(RIG, **cache) > 0
    assert translations(RIG, **cache) == 0


def test_after_a_first_formula_one_of_any_kind_translates_nothing():
    # A first one may: it finds the cache that other tests have filled.
    assert translations(JOINT + FORMULA.format(formula="k * theta + c * omega") + NEW) > 0
    assert translations(FORMULA.format(formula="k * theta + c * omega * sympy.Abs(omega)")) == 0
