"""Elements in exported code: the same moment and the same motion as in the simulation of the package."""

import importlib.util
import shutil
import subprocess

import numpy as np
import pytest
from conftest import ELEMENTS

from sindyjoint.export import export_model, write_export
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.stickslip import simulate
from sindyjoint.response.model_law import model_law

RATE, DURATION = 2000.0, 0.5  # Hz, s: two periods
#: Every kind of element, with the paper's terms beside it and without its Coulomb friction.
CASES = [pytest.param(name, friction, id=f"{name}-{friction}") for name in ELEMENTS for friction in (1.867, 0.0)]


def drive(amplitude=6.0):
    """Samples of a moment at 4 Hz, joined by straight lines."""
    time = np.arange(int(DURATION * RATE) + 1) / RATE
    return amplitude * np.sin(2 * np.pi * 4 * time)


def terms(friction):
    """The paper's terms with another friction; a softening joint would snap through where friction is missing."""
    found = {"linear_stiffness": 6066.0, "cubic_stiffness": -1e9, "linear_damping": 48.13}
    return found | ({"coulomb_friction": friction} if friction else {})


def ours(model, moment, hold=False):
    """Return angle and whether the joint sticks, by the package."""
    excitation = sampled(moment, RATE, "hold" if hold else "linear")
    motion = simulate(model_law(model), excitation, DURATION, RATE, rtol=1e-8, limits=None)
    return motion.angle, motion.stuck


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("name", "friction"), CASES)
def test_python_steps_with_an_element_equal_our_simulation(make_model, tmp_path, name, friction):
    model, moment = make_model(terms(friction), elements=[ELEMENTS[name]]), drive()
    (path,) = write_export(export_model(model, "python"), tmp_path)
    angle, rate = load(path).simulate(moment.tolist(), 1 / RATE, limits=None)
    expected, stuck = ours(model, moment)
    assert np.abs(np.array(angle[:-1]) - expected).max() < 1e-3 * np.abs(expected).max()
    if friction:
        assert stuck.any() and np.mean((np.array(rate[:-1]) == 0.0) != stuck) < 0.01


def test_an_element_that_is_left_out_of_the_code_shows(make_model, tmp_path):
    # Negative control: without its element the module moves by more than ten times what the comparison allows.
    whole, part = (make_model(terms(1.867), elements=e) for e in ([ELEMENTS["jenkins_element"]], ()))
    (path,) = write_export(export_model(part, "python"), tmp_path)
    angle, _ = load(path).simulate(drive().tolist(), 1 / RATE, limits=None)
    expected, _ = ours(whole, drive())
    assert np.abs(np.array(angle[:-1]) - expected).max() > 0.1 * np.abs(expected).max()


def test_all_elements_together_in_python_and_c(make_model, tmp_path):
    model, moment = make_model(terms(1.0), elements=ELEMENTS.values()), drive(12.0)
    (path,) = write_export(export_model(model, "python"), tmp_path)
    module = load(path)
    state = [0.0] * len(module.STATES)
    angle, rate = module.simulate(moment.tolist(), 1 / RATE, limits=None, state=state)
    assert module.STATES[:2] == ["jenkins_element.z", "backlash_play.z"] and all(state)
    assert abs(state[0]) <= 2e-4
    expected, _ = ours(model, moment)
    assert np.abs(np.array(angle[:-1]) - expected).max() < 1e-3 * np.abs(expected).max()

    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler is installed")
    write_export(export_model(model, "c"), tmp_path / "joint.h")
    (tmp_path / "main.c").write_text(HARNESS)
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wno-unused-variable", "-Wno-unused-const-variable", "-Werror"]
    subprocess.run([compiler, *flags, "main.c", "-lm", "-o", "main"], cwd=tmp_path, check=True)
    text = f"{moment.size} {1 / RATE!r}\n" + "\n".join(map(repr, moment.tolist()))
    done = subprocess.run([str(tmp_path / "main")], input=text, capture_output=True, text=True, check=True)
    motion = np.array([line.split() for line in done.stdout.splitlines()], float)
    np.testing.assert_allclose(motion[:, 0], angle, atol=1e-9 * np.abs(angle).max())
    np.testing.assert_array_equal(motion[:, 1] == 0.0, np.array(rate) == 0.0)


HARNESS = r"""
#include <stdio.h>
#include "joint.h"
int main(void)
{
    double theta = 0.0, omega = 0.0, z[JOINT_STATES] = {0.0}, last = 0.0, a, dt;
    int n, i;
    if (scanf("%d %lf", &n, &dt) != 2) return 1;
    for (i = 0; i < n; ++i) {
        if (scanf("%lf", &a) != 1) return 1;
        if (i && joint_step(&theta, &omega, z, last, a, dt, JOINT_INERTIA) < 0) return 1;
        last = a;
        printf("%.17g %.17g\n", theta, omega);
    }
    return 0;
}
"""


def test_fmu_with_elements_equals_our_simulation(make_model, tmp_path):
    pytest.importorskip("pythonfmu", reason="pythonfmu (extra 'fmu') is not installed")
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy.validation import validate_fmu

    model, moment = make_model(terms(1.0), elements=ELEMENTS.values()), drive(12.0)
    (path,) = write_export(export_model(model, "fmu"), tmp_path / "joint.fmu")
    assert validate_fmu(str(path)) == []
    time = np.arange(moment.size) / RATE
    given = np.array(list(zip(time, moment, strict=True)), dtype=[("time", float), ("moment", float)])
    result = fmpy.simulate_fmu(
        str(path), stop_time=DURATION, step_size=1 / RATE, output_interval=1 / RATE, input=given,
        output=["angle", "state_jenkins_element_z"],
    )  # fmt: skip
    expected, _ = ours(model, moment, hold=True)
    assert np.abs(result["angle"][: expected.size] - expected).max() < 1e-3 * np.abs(expected).max()
    assert np.abs(result["state_jenkins_element_z"]).max() == pytest.approx(2e-4)
