"""Laws that depend on inputs: parameters of code, tables of decks elsewhere, held at values where asked."""

import csv
import io
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import JointModel
from sindyjoint.export import export_model, write_export
from sindyjoint.inputs import Input
from tests.export.made import MOMENT_RMS, PAPER, RATE, model_of
from tests.made_models import term

WARM = Input("temperature", "K", 293.15, shown_unit="degC", zero=273.15, tested=(233.15, 333.15), levels=5)
# An input whose name the templates use themselves.
SLOPE = Input("slope", "V", 0.5, tested=(0.0, 2.0), levels=5)
# Coefficients and formulas of what depends on inputs.
OWN = {
    "linear_stiffness_by_temperature": (6.0, "(temperature - temperature_ref)*theta"),
    "coulomb_friction_by_temperature": (-0.004, "(temperature - temperature_ref)*sign(omega)"),
    "linear_damping_by_slope": (4.0, "(slope - slope_ref)*omega"),
    "linear_damping_by_slope_squared": (3.0, "(slope - slope_ref)**2*omega"),
}
DRIVE = (2.8 * np.sin(0.02 * np.arange(400))).tolist()


@pytest.fixture(scope="module")
def model():
    plain, terms = model_of(PAPER), []
    for name, (value, formula) in OWN.items():
        each = WARM if "temperature" in name else SLOPE
        made = term(name, formula, value, abs(1e-3 * value))
        references = ((f"{each.name}_ref", each.reference),)
        terms.append(replace(made, parameters=references, inputs=(each.name,)))
    terms = (*plain.terms, *terms)
    covariance = np.diag([one.standard_error**2 for one in terms])
    return JointModel(
        plain.joint, terms, tuple(map(tuple, covariance.tolist())), plain.fitted, (), (WARM, SLOPE)
    )


def module_of(export):
    names = {}
    exec(compile(export.files["joint.py"], "joint.py", "exec"), names)
    return names


def test_python_takes_inputs_as_keywords(model):
    code = module_of(export_model(model, "python"))
    for given in ({}, {"temperature": 240.0}, {"temperature": 320.0, "slope": 1.7}):
        own = {f"input_{k}" if k == "slope" else k: v for k, v in given.items()}
        truth = model.moment(3e-4, 0.01, inputs=given)
        assert code["transfer_moment"](3e-4, 0.01, **own) == pytest.approx(float(truth), rel=1e-13)
        held = module_of(export_model(model, "python", at=given or {"slope": 0.5}))
        motion, same = code["simulate"](DRIVE, 1e-3, **own), held["simulate"](DRIVE, 1e-3)
        # The held law steps by its own stiffness, so steps differ: RK4 at a tenth of the fastest time constant.
        np.testing.assert_allclose(motion[0], same[0], atol=1e-6 * max(map(abs, same[0])))
    row = export_model(model, "python").fidelity[0]
    assert row.carried and "parameter temperature, K; unless given, 20 degC" in row.representation


def test_limits_of_code_hold_wherever_inputs_were_tested(model):
    code = module_of(export_model(model, "python"))
    soft = module_of(export_model(model, "python", at={"temperature": 233.15}))
    steep = module_of(export_model(model, "python", at={"temperature": 333.15, "slope": 2.0}))
    assert code["ANGLE_LIMITS"] == pytest.approx(soft["ANGLE_LIMITS"])
    assert code["STIFFNESS"] == pytest.approx(steep["STIFFNESS"])
    assert code["DAMPING"] == pytest.approx(steep["DAMPING"])


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_c_takes_inputs_as_arguments(model, tmp_path):
    write_export(export_model(model, "c"), tmp_path / "joint.h")
    (tmp_path / "try.c").write_text(
        '#include <stdio.h>\n#include "joint.h"\n'
        "int main(void)\n{\n    double angle = 0, rate = 0, low, high;\n    int i;\n"
        "    for (i = 0; i < 399; i++)\n"
        "        joint_step(&angle, &rate, 2.8 * sin(0.02 * i), 2.8 * sin(0.02 * (i + 1)), 1e-3, 0.02, 320.0, 1.7);\n"
        "    joint_friction_interval(0.0, 320.0, 1.7, &low, &high);\n"
        '    printf("%.17g %.17g %.17g %.17g", joint_moment(3e-4, 0.01, 320.0, 1.7), angle, low, high);\n'
        "    return 0;\n}\n"
    )
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-ffp-contract=off"]
    subprocess.run(["cc", *flags, "try.c", "-o", "try", "-lm"], cwd=tmp_path, check=True)
    said = subprocess.run([tmp_path / "try"], capture_output=True, text=True, check=True).stdout
    code = module_of(export_model(model, "python"))
    given = {"temperature": 320.0, "input_slope": 1.7}
    low, high = code["friction_interval"](0.0, **given)
    angle = code["simulate"](DRIVE, 1e-3, **given)[0][-1]
    own = [code["transfer_moment"](3e-4, 0.01, **given), angle, low, high]
    np.testing.assert_allclose([float(word) for word in said.split()], own, rtol=1e-9)


def test_fmu_has_inputs_beside_the_moment(model, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    pytest.importorskip("pythonfmu", reason="pythonfmu (extra 'fmu') is not installed")
    (path,) = write_export(export_model(model, "fmu"), tmp_path)
    known = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    assert known["temperature"].causality == known["input_slope"].causality == "input"
    assert float(known["temperature"].start) == 293.15


@pytest.mark.parametrize("target", ["abaqus", "ansys", "mujoco", "nastran", "opensees", "simscape"])
def test_other_programs_get_a_table_of_decks(model, target):
    alone = replace(
        model, terms=tuple(t for t in model.terms if "temperature" not in t.inputs), covariance=()
    )
    made = export_model(alone, target)
    table = list(csv.DictReader(io.StringIO(made.files["lookup.csv"])))
    assert [float(row["slope [V]"]) for row in table] == [0.0, 0.5, 1.0, 1.5, 2.0]
    for row in table:
        held = export_model(alone, target, at={"slope": float(row["slope [V]"])})
        for name, content in held.files.items():
            assert made.files[f"{row['folder']}/{name}"] == content
    # Straight lines over halves of a volt miss a parabola of 3 N·m·s/(rad·V²) by 3·0.5²/4 in the middle.
    rate = RATE * np.sqrt(np.mean(np.linspace(0.1, 1, 10) ** 2) / 2)
    assert made.fidelity[0].error == pytest.approx(3 * 0.5**2 / 4 * rate / MOMENT_RMS, rel=0.02)
    assert "lookup: 5 decks from 0 V to 2 V" in made.fidelity[0].representation
    assert made.fidelity[-1].term == "all terms"


def test_a_table_of_decks_is_written_in_folders(model, tmp_path):
    write_export(export_model(model, "nastran"), tmp_path / "out")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "out" / "lookup.csv").read_text())))
    assert len(rows) == 9
    assert all((tmp_path / "out" / row["folder"] / "joint.bdf").is_file() for row in rows)
    assert rows[0]["folder"] == "temperature_-40degC_slope_0V"
