"""Exported joints run by the programs that they are written for, under the same samples of a moment."""

import importlib.util
import shutil
import subprocess

import numpy as np

from sindyjoint.export import export_model, write_export
from sindyjoint.mechanics import sampled, simulate
from sindyjoint.response import model_law

RATE = 2000.0  # Hz, of the samples, which straight lines join
#: What a runner needs beside numpy; a compiler is looked for.
NEEDS = {"mujoco": ["mujoco"], "opensees": ["openseespy.opensees"], "fmu": ["pythonfmu", "fmpy"]}


def drive(amplitude=5.0, periods=2, frequency=4.0):
    """Samples of a harmonic moment."""
    time = np.arange(round(periods / frequency * RATE) + 1) / RATE
    return amplitude * np.sin(2 * np.pi * frequency * time)


def ours(model, moment, hold=False):
    """Return angle and whether the joint sticks, by the package, at all samples but the last."""
    excitation = sampled(moment, RATE, "hold" if hold else "linear")
    motion = simulate(model_law(model), excitation, (moment.size - 1) / RATE, RATE, rtol=1e-9, limits=None)
    return motion.angle, motion.stuck


def load(path, name=None):
    """Import a file."""
    spec = importlib.util.spec_from_file_location(name or path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_python(model, moment, folder):
    (path,) = write_export(export_model(model, "python"), folder / "joint.py")
    return np.array(load(path).simulate(moment.tolist(), 1 / RATE, limits=None)[0])


HARNESS = r"""
#include <stdio.h>
#include "joint.h"
int main(void)
{
    double theta = 0.0, omega = 0.0, z[JOINT_STATES + 1] = {0.0}, last = 0.0, a, dt;
    int n, i;
    (void)z;
    if (scanf("%d %lf", &n, &dt) != 2) return 1;
    for (i = 0; i < n; ++i) {
        if (scanf("%lf", &a) != 1) return 1;
        if (i && joint_step(&theta, &omega,@ last, a, dt, JOINT_INERTIA) < 0) return 1;
        last = a;
        printf("%.17g %.17g\n", theta, omega);
    }
    return 0;
}
"""
FLAGS = [
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wno-unused-variable",
    "-Wno-unused-const-variable",
    "-Werror",
]


def compiler():
    """Return a C compiler, or nothing."""
    return shutil.which("gcc") or shutil.which("cc")


def run_c(model, moment, folder):
    write_export(export_model(model, "c"), folder / "joint.h")
    (folder / "main.c").write_text(HARNESS.replace("@", " z," if model.elements else ""))
    subprocess.run([compiler(), *FLAGS, "main.c", "-lm", "-o", "main"], cwd=folder, check=True)
    text = f"{moment.size} {1 / RATE!r}\n" + "\n".join(map(repr, moment.tolist()))
    done = subprocess.run([str(folder / "main")], input=text, capture_output=True, text=True, check=True)
    return np.array([line.split()[0] for line in done.stdout.splitlines()], float)


def run_fmu(model, moment, folder, output=("angle",)):
    import fmpy

    (path,) = write_export(export_model(model, "fmu"), folder / "joint.fmu")
    time = np.arange(moment.size) / RATE
    given = np.array(list(zip(time, moment, strict=True)), dtype=[("time", float), ("moment", float)])
    result = fmpy.simulate_fmu(
        str(path), stop_time=float(time[-1]), step_size=1 / RATE, output_interval=1 / RATE, input=given,
        output=list(output),
    )  # fmt: skip
    found = [result[name] for name in output]
    return found[0] if len(found) == 1 else found


def mujoco_model(model):
    """Return the compiled model of MuJoCo; a warning of its compiler is an error."""
    import mujoco

    return mujoco.MjModel.from_xml_string(export_model(model, "mujoco").files["joint.xml"])


def run_mujoco(model, moment, folder):
    import mujoco

    compiled = mujoco_model(model)
    data, step = mujoco.MjData(compiled), compiled.opt.timestep
    time = np.arange(moment.size) / RATE
    steps = int(np.ceil(time[-1] / step)) + 1
    forces = np.interp((np.arange(steps) + 0.5) * step, time, moment)
    angle = np.zeros(steps + 1)
    for i in range(steps):
        data.qfrc_applied[0] = forces[i]
        mujoco.mj_step(compiled, data)
        angle[i + 1] = data.qpos[0]
    return np.interp(time, np.arange(steps + 1) * step, angle)


def run_opensees(model, moment, folder, parts=10):
    """Newmark with average acceleration, ``parts`` steps between two samples."""
    import openseespy.opensees as ops

    (path,) = write_export(export_model(model, "opensees"), folder / "joint_opensees.py")
    rotation = model.joint.motion == "rotation"
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for node in (1, 2):
        ops.node(node, 0.0, 0.0)
    ops.fix(1, 1, 1, 1)
    ops.fix(2, *((1, 1, 0) if rotation else (0, 1, 1)))
    direction = np.array([0.0, 0.0, 1.0] if rotation else [1.0, 0.0, 0.0])
    ops.mass(2, *(model.inertia * direction))
    load(path).add_joint(ops, 1, 2, 10, 20, 30)
    step = 1 / RATE / parts
    ops.timeSeries("Path", 1, "-dt", 1 / RATE, "-values", *moment)
    ops.pattern("Plain", 1, 1)
    ops.load(2, *direction)
    ops.constraints("Transformation")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-14, 100)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    angle = np.zeros(moment.size)
    for i in range(1, moment.size):
        assert ops.analyze(parts, step) == 0
        angle[i] = ops.nodeDisp(2, 3 if rotation else 1)
    ops.wipe()
    return angle


RUNNERS = {
    "python": run_python, "c": run_c, "fmu": run_fmu, "mujoco": run_mujoco, "opensees": run_opensees,
}  # fmt: skip


def missing(target):
    """Return what a target needs and is not installed; nothing where it can run."""
    import importlib

    for name in NEEDS.get(target, []):
        try:
            importlib.import_module(name)
        except (ImportError, RuntimeError) as error:  # OpenSees without its libraries raises the latter
            return f"{name} cannot be imported: {str(error).splitlines()[0]}"
    return "no C compiler is installed" if target == "c" and compiler() is None else ""


def difference(target, model, moment, folder):
    """Return the largest difference from our angle, as a share of its largest: while it slips, and at all times."""
    angle = RUNNERS[target](model, moment, folder)
    expected, stuck = ours(model, moment, hold=target == "fmu")
    apart = np.abs(angle[: expected.size] - expected) / np.abs(expected).max()
    return float(apart[~stuck].max()), float(apart.max())
