"""Exported code against the model and against the simulation of the package: Python, C and FMU."""

import ast
import importlib.util
import shutil
import subprocess
import zipfile

import numpy as np
import pytest

from sindyjoint.errors import MissingExtraError
from sindyjoint.export import export_model, write_export
from sindyjoint.mechanics import FormulaLaw, PaperLaw, sampled, simulate

RATE, DURATION = 2000.0, 1.0  # Hz, s: four periods, the joint sticks in each of them twice
LAW = PaperLaw(6.066e3, -1.927e5, -2.684e9, 48.13, 1.867, inertia=0.02)
HARD = {
    "linear_stiffness": 6066.0, "constant_moment": 0.3, "dead_zone": 900.0, "bilinear_stiffness": 400.0,
    "hard_stop": 200.0, "quadratic_damping": 90.0, "stribeck_friction": 0.4, "smoothed_friction": 0.2,
    "position_dependent_friction": 300.0, "asymmetric_damping": 2e3, "coulomb_friction": 1.2,
}  # fmt: skip


def drive():
    """Samples of a moment of 5 N·m at 4 Hz, joined by straight lines."""
    time = np.arange(int(DURATION * RATE) + 1) / RATE
    return 5.0 * np.sin(2 * np.pi * 4 * time)


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def python_module(tmp_path):
    def make(model):
        (path,) = write_export(export_model(model, "python"), tmp_path)
        return load(path)

    return make


@pytest.mark.parametrize("terms", [None, HARD], ids=["paper", "hard"])
def test_python_law_equals_the_model(make_model, python_module, states, terms):
    model = make_model(terms) if terms else make_model()
    module = python_module(model)
    given = [module.transfer_moment(theta, omega) for theta, omega in zip(*states, strict=True)]
    np.testing.assert_allclose(given, model.moment(*states), rtol=1e-13, atol=1e-13)


def test_python_module_needs_nothing_but_math(paper_model):
    tree = ast.parse(export_model(paper_model, "python").files["joint.py"])
    imported = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [alias.name for node in imported for alias in node.names] == ["math"]


def test_python_steps_equal_our_simulation(paper_model, python_module):
    # Both are within 1e-6 of the exact motion: ours by its tolerance, the module by steps of a tenth of the fastest
    # time constant (RK4 at h·λ = 0.1: 1e-5 / 120 per step).
    module, moment = python_module(paper_model), drive()
    angles, rates = module.simulate(moment.tolist(), 1 / RATE)
    ours = simulate(LAW, sampled(moment, RATE, "linear"), DURATION, RATE, rtol=1e-10)
    angles, rates = np.array(angles[:-1]), np.array(rates[:-1])
    assert np.abs(angles - ours.angle).max() < 1e-6 * np.abs(ours.angle).max()
    # Sticking is exact, not slow: the same samples stand still, to the last bit.
    stuck = rates == 0.0
    assert stuck.any() and np.mean(stuck != ours.stuck) < 2e-3
    both = stuck[1:] & stuck[:-1]
    assert np.all(np.diff(angles)[both] == 0.0)


def test_python_steps_of_a_rich_law_equal_our_simulation(make_model, python_module):
    # Eleven terms, five of them with jumps or kinks; our side gets the sum of the sympy expressions, not the code.
    model, moment = make_model(HARD), 0.8 * drive()
    law = FormulaLaw(sum(t.coefficient * t.expression for t in model.terms), inertia=0.02)
    ours = simulate(law, sampled(moment, RATE, "linear"), DURATION, RATE, rtol=1e-10, limits=None)
    angles, rates = python_module(model).simulate(moment.tolist(), 1 / RATE, limits=None)
    assert np.abs(np.array(angles[:-1]) - ours.angle).max() < 2e-6 * np.abs(ours.angle).max()
    assert np.mean((np.array(rates[:-1]) == 0.0) != ours.stuck) < 2e-3


def test_python_joint_inside_its_dead_band_stays_exactly_there(paper_model, python_module):
    module = python_module(paper_model)
    angles, rates = module.simulate([1.8 * (-1) ** i for i in range(200)], 1e-3)
    assert set(angles) == {0.0} and set(rates) == {0.0}


def test_python_ring_down_loses_two_friction_moments_over_stiffness_per_half_cycle(make_model, python_module):
    # Coulomb ring-down, closed form: each turn is 2·M_F/k nearer to zero than the one before.
    module = python_module(make_model({"linear_stiffness": 6066.0, "coulomb_friction": 0.3}))
    angles, rates = module.simulate([0.0] * 500, 1e-4, theta=7e-4)
    theta, side = 7e-4, 1
    while theta > 0.3 / 6066:
        theta, side = theta - 2 * 0.3 / 6066, -side
    # A tenth of the fastest time constant per step leaves 1e-7 of the start's amplitude after seven turns.
    assert angles[-1] == pytest.approx(side * theta, abs=1e-7 * 7e-4)
    assert rates[-1] == 0.0


def test_python_says_where_the_joint_softens(paper_model, python_module):
    module = python_module(paper_model)
    with pytest.raises(ArithmeticError, match=r"the angle left \(-0.00089.*lower the moment"):
        module.simulate([8.0] * 2000, 1e-3)


def test_python_without_inertia_asks_for_one(make_model, python_module):
    module = python_module(make_model(inertia=None))
    with pytest.raises(ValueError, match="inertia is 0.0; expected a positive moving inertia"):
        module.step(0.0, 0.0, 5.0, 5.0, 1e-3)
    assert module.step(0.0, 0.0, 5.0, 5.0, 1e-3, inertia=0.02)[1] > 0


# C -------------------------------------------------------------------------------------------------------------------

HARNESS = r"""
#include <stdio.h>
#include "joint.h"
int main(void)
{
    double a, b, theta = 0.0, omega = 0.0, last = 0.0, low, high;
    int n, i, status = 0;
    puts(JOINT_NAME);
    if (scanf("%d", &n) != 1) return 1;
    for (i = 0; i < n; ++i) {
        if (scanf("%lf %lf", &a, &b) != 2) return 1;
        joint_friction_interval(a, &low, &high);
        printf("%.17g %.17g %.17g\n", joint_moment(a, b), low, high);
    }
    if (scanf("%d %lf", &n, &b) != 2) return 1;
    for (i = 0; i < n; ++i) {
        if (scanf("%lf", &a) != 1) return 1;
        if (i) status = joint_step(&theta, &omega, last, a, b, JOINT_INERTIA);
        if (status) return 2;
        last = a;
        printf("%.17g %.17g\n", theta, omega);
    }
    return joint_step(&theta, &omega, 0.0, 0.0, b, 0.0) == -1 ? 0 : 3;
}
"""


@pytest.fixture
def run_c(tmp_path):
    """Compile the exported header with every warning an error, run it, and return what it prints."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler is installed")

    def run(model, text):
        write_export(export_model(model, "c"), tmp_path / "joint.h")
        (tmp_path / "main.c").write_text(HARNESS)
        flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
        program = tmp_path / "program"
        subprocess.run([compiler, *flags, "main.c", "-lm", "-o", str(program)], cwd=tmp_path, check=True)
        done = subprocess.run(
            [str(program)], input=text, capture_output=True, text=True, check=True, timeout=60
        )
        return done.stdout.splitlines()

    return run


@pytest.mark.parametrize("terms", [None, HARD], ids=["paper", "hard"])
def test_c_law_and_steps_equal_the_model_and_the_python_module(
    make_model, run_c, python_module, states, terms
):
    model = make_model(terms) if terms else make_model()
    module, moment = python_module(model), 0.8 * drive()
    points = "\n".join(f"{a!r} {b!r}" for a, b in zip(*(s.tolist() for s in states), strict=True))
    samples = "\n".join(repr(value) for value in moment.tolist())
    name, *lines = run_c(model, f"{len(states[0])}\n{points}\n{moment.size} {1 / RATE!r}\n{samples}\n")
    assert name == "inter-panel joint"
    table = np.array([line.split() for line in lines[: len(states[0])]], float)
    np.testing.assert_allclose(table[:, 0], model.moment(*states), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        table[:, 1:], [module.friction_interval(a) for a in states[0]], rtol=1e-12, atol=1e-13
    )
    motion = np.array([line.split() for line in lines[len(states[0]) :]], float)
    angles, rates = module.simulate(moment.tolist(), 1 / RATE)
    # The same algorithm in another language: what differs is rounding, which the joint damps.
    np.testing.assert_allclose(motion[:, 0], angles, atol=1e-9 * np.abs(angles).max())
    np.testing.assert_array_equal(motion[:, 1] == 0.0, np.array(rates) == 0.0)


# FMU -----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def unit(tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu (extra 'fmu') is not installed")

    def make(model, name="joint.fmu"):
        (path,) = write_export(export_model(model, "fmu"), tmp_path / name)
        return path

    return make


def test_fmu_equals_our_simulation(paper_model, unit):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    path = unit(paper_model)
    assert validate_fmu(str(path)) == []
    moment = drive()
    time = np.arange(moment.size) / RATE
    given = np.array(list(zip(time, moment, strict=True)), dtype=[("time", float), ("moment", float)])
    result = fmpy.simulate_fmu(
        str(path), stop_time=DURATION / 2, step_size=1 / RATE, output_interval=1 / RATE, input=given,
        output=["angle", "rate", "stuck"],
    )  # fmt: skip
    # The unit holds its input over a step, and so does this excitation.
    ours = simulate(LAW, sampled(moment, RATE, "hold"), DURATION / 2, RATE, rtol=1e-9)
    n = ours.angle.size
    assert np.abs(result["angle"][:n] - ours.angle).max() < 1e-5 * np.abs(ours.angle).max()
    assert np.mean((result["rate"][:n] == 0.0) == ours.stuck) > 0.995
    assert result["stuck"].any() and not result["stuck"].all()


def test_fmu_carries_its_fidelity_table_and_leaves_no_trace(paper_model, make_model, unit):
    import sys

    before, modules = list(sys.path), {name for name in sys.modules if name.startswith("joint_")}
    first, second = unit(paper_model, "a.fmu"), unit(make_model({"linear_stiffness": 5000.0}), "b.fmu")
    assert sys.path == before
    assert {name for name in sys.modules if name.startswith("joint_")} == modules
    names = []
    for path in (first, second):
        with zipfile.ZipFile(path) as archive:
            assert "linear_stiffness" in archive.read("documentation/fidelity.txt").decode()
            names.append(archive.read("resources/slavemodule.txt").decode())
    assert names[0] != names[1]  # two joints in one simulator must not share a module


def test_fmu_without_pythonfmu_names_the_extra(paper_model, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pythonfmu.builder", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'sindyjoint\[fmu\]'"):
        export_model(paper_model, "fmu")
