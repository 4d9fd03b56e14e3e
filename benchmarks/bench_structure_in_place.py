"""What runs of a structure that do not repeat show of an effect hidden in its joint, or of a structure that is another.

    python benchmarks/bench_structure_in_place.py run --out found.jsonl --names nothing quadratic_damping --seeds 0 1 2
    python benchmarks/bench_structure_in_place.py run --out found.jsonl --names beams --given --seeds 0 1 2
    python benchmarks/bench_structure_in_place.py show found.jsonl

The pulse rig with a random joint, five accelerometers and a force cell with 1 % noise, four sweeps of 10 s at levels of
their own. Hidden: nothing, quadratic damping, a Jenkins element in the place of the friction, or beams 5 % stiffer than
described. `--given`: the joint's five terms are known within 0.3 %; else its law is found in the same runs.
"""

from __future__ import annotations

import os
import sys
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import bench_structure_discovery as discovery  # noqa: E402
from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402

NAMES = ("nothing", "quadratic_damping", "jenkins", "beams")
CALLED = {"quadratic_damping": "quadratic_damping", "jenkins": "jenkins_element", "beams": "beam_stiffness"}
LEVELS = (1.0, 0.9, 0.8, 0.7)
RIG, SECONDS, STIFFER = "pulse-rig", 10.0, 1.05


def _quadratic(theta, omega, direction, state, p, out):
    out[0] = theta * (p[0] + theta * (p[1] + theta * p[2])) + p[3] * omega + p[4] * direction
    out[0] += p[5] * omega * abs(omega)


def hidden(name, law, generator):
    """Return the law with an effect in it, and the factor of the beams' stiffness."""
    from sindyjoint.mechanics import FunctionLaw
    from tests.diagnosis.hidden_structures import _jenkins

    more = dict(inertia=law.inertia, softening_limit=tuple(law.softening_limit))
    if name == "quadratic_damping":
        return FunctionLaw(_quadratic, (*law.parameters, generator.uniform(1000, 2500)), **more), 1.0
    if name == "jenkins":
        yields = 10 ** generator.uniform(-5, -4.3)
        return FunctionLaw(_jenkins, (*law.parameters, yields), n_states=1, **more), 1.0
    return law, STIFFER if name == "beams" else 1.0


def campaign(name, seed):
    """Return the virtual test, and the true law without what is hidden."""
    from sindyjoint.mechanics.rig_test import Chain, RigTest, Sensor
    from sindyjoint.mechanics.rigs import load_rig
    from sindyjoint.mechanics.structure import assemble
    from sindyjoint.mechanics.virtual_rig import Drive, Recorder

    generator = np.random.default_rng(90_000 + seed)
    rig, laws = discovery.with_random_laws(load_rig(RIG), generator)
    ((kind, law),) = laws.items()
    other, stiffer = hidden(name, law, generator)
    stations = discovery.STATIONS[RIG]
    described = assemble(rig.items, rig.clamp_stiffness, stations)
    loss = float(described.frequencies(1)[0])
    true = assemble(discovery.with_other_beams(rig, stiffer, 1.0).items, rig.clamp_stiffness, stations, loss)
    sensors = tuple(Sensor(station, station) for station in stations)
    recorder = Recorder(noise=0.01, step=1.25e-4, duration=SECONDS)
    drive = Drive("trial", "sweep", 1.0, band=discovery.BANDS[RIG])
    # The force is found with the paper's law, whose softening limit is known.
    top = discovery.find_force(true, "tip", sensors, drive, recorder, 1.5)
    drives = [replace(drive, name=f"sweep {level:g}", amplitude=level * top) for level in LEVELS]
    true = replace(true, hinges=tuple(replace(hinge, law=other) for hinge in true.hinges))
    chain = Chain(tuple(rig.items), rig.clamp_stiffness, stations, loss)
    kinds = (kind,) * true.n_joints
    test = RigTest(RIG, true, kinds, "tip", sensors, (), chain=chain)
    test = discovery.recorded(test, drives, recorder, "sweep", generator)
    return replace(test, structure=chain.assembled()), law


def one(name, seed, given):
    """Return what is found of one campaign."""
    from sindyjoint.diagnosis.structure.start import model_of_law
    from sindyjoint.workflows.diagnose import diagnose_rig

    record = dict(name=name, seed=seed, given=given)
    try:
        test, law = campaign(name, seed)
        begun = time.process_time()
        result = diagnose_rig(
            test, model_of_law(law, 1e-3, 0.05, 0.003) if given else None, random_state=seed
        )
    except Exception as error:  # a benchmark goes on, and says what failed
        return {**record, "error": f"{type(error).__name__}: {error}"}
    steps = [dict(effect=step.effect, parameters=step.parameters) for step in result.steps]
    gaps = [result.initial.response, result.final.response, result.noise_floor.response]
    return {
        **record, "verdict": result.verdict, "steps": steps, "gaps": gaps, "seconds": time.process_time() - begun
    }  # fmt: skip


def run(arguments):
    done = done_in(arguments.out, ("name", "seed", "given"))
    for seed in arguments.seeds:
        for name in arguments.names or NAMES:
            if (name, seed, arguments.given) not in done:
                append(arguments.out, one(name, seed, arguments.given))


def show(arguments):
    groups = defaultdict(list)
    for record in records_in(arguments.paths):
        groups[record["name"], record["given"]].append(record)
    for (name, given), found in groups.items():
        print(f"{name}, law {'given' if given else 'found in the same runs'}: {len(found)} campaigns")
        for each in found:
            if "error" in each:
                print(f"  {each['seed']}: {each['error']}")
                continue
            steps = " + ".join(step["effect"] for step in each["steps"]) or "nothing"
            before, after, floor = (f"{100 * gap:.2f}" for gap in each["gaps"])
            print(f"  {each['seed']}: {each['verdict']}, {steps}; gap {before} -> {after} %, floor {floor} %, "
                  f"{each['seconds']:.0f} s")  # fmt: skip


if __name__ == "__main__":
    main(__doc__, run, show, given=dict(action="store_true"))
