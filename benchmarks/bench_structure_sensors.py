"""How the law of a joint inside a structure depends on sensors and noise: a grid, and its picture.

    python benchmarks/bench_structure_sensors.py run --out grid.json
    python benchmarks/bench_structure_sensors.py show grid.json --figure docs/images/structure-sensors.png

The pulse rig with the paper's joint, twelve sines, simulated once without noise; every cell takes some of its sensors
and adds noise of its own. A cell that is there already is not made again.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bench_structure_discovery import LEVELS, NAMES, SINES
from benchmarks.resumed import with_rows, write_rows
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics.rig_test import RigTest, Sensor
from sindyjoint.mechanics.rigs import load_rig
from sindyjoint.mechanics.structure import assemble
from sindyjoint.mechanics.virtual_rig import Drive, Recorder, virtual_rig_test
from sindyjoint.paper import TERMS

STATIONS = {"clamp": ("lower beam", 0.03), "a": ("lower beam", 0.3), "b": ("lower beam", 0.5),
            "c": ("upper beam", 0.15), "d": ("upper beam", 0.35), "e": ("upper beam", 0.5)}  # fmt: skip
SENSORS = {
    "five: both beams": "abcde",
    "three: joint, middle, tip": "bde",
    "two: joint, tip": "be",
    "two: behind the joint": "ce",
    "two: clamp, tip": ("clamp", "e"),
    "one: tip": "e",
}
NOISE = (0.003, 0.01, 0.03, 0.1)
FORCE = 0.97  # of the force at which the paper's joint comes near the wanted angle


def exact_test():
    """Return the virtual test with every sensor and no noise."""
    rig = load_rig("pulse-rig")
    structure = assemble(rig.items, rig.clamp_stiffness, STATIONS)
    structure = replace(structure, loss_frequency=float(structure.frequencies(1)[0]))
    test = RigTest(
        "sensors", structure, tuple(h.law.name for h in structure.hinges), "tip",
        tuple(Sensor(name, name) for name in STATIONS), (),
    )  # fmt: skip
    drives = [
        Drive(f"{f:g} Hz {level:g}", "sine", FORCE * level * force, f, level=f"{level:g}")
        for f, force in SINES["pulse-rig"].items()
        for level in LEVELS
    ]
    return virtual_rig_test(test, drives, Recorder(noise=0.0, step=1.25e-4))


def cell(test, sensors, noise, generator):
    """Return what was found with some of the sensors and noise of a share of each channel's RMS."""
    from sindyjoint.workflows.discover import discover_rig

    rows = [number for number, sensor in enumerate(test.sensors) if sensor.name in sensors]

    def noisy(signal):
        return signal + noise * np.std(signal) * generator.normal(size=signal.size)

    runs = tuple(
        replace(run, drive=noisy(run.drive), responses=np.array([noisy(run.responses[row]) for row in rows]))
        for run in test.runs
    )
    taken = replace(test, sensors=tuple(test.sensors[row] for row in rows), runs=runs)
    try:
        (law,) = discover_rig(taken, random_state=0).laws
    except SindyJointError as error:
        return {"terms": [], "verdict": str(error), "errors": {}}
    if law.discovery is None:
        return {"terms": [], "verdict": law.reason, "errors": {}}
    truth = dict(zip(TERMS, (getattr(test.structure.hinges[0].law, name) for name in NAMES), strict=True))
    return {
        "terms": list(law.discovery.model.ids),
        "verdict": law.discovery.verdict.verdict,
        "errors": {
            t.id: [t.coefficient / truth[t.id] - 1, t.standard_error / abs(truth[t.id])]
            for t in law.discovery.model.terms
            if t.id in truth
        },
    }


def run(out):
    """Write the cells as they are made."""
    path = Path(out)
    cells = json.loads(path.read_text()) if path.is_file() else {}
    test = exact_test()
    for number, (name, sensors) in enumerate(SENSORS.items()):
        for place, noise in enumerate(NOISE):
            key = f"{name} | {noise:g}"
            if key not in cells:
                cells[key] = cell(test, sensors, noise, np.random.default_rng([number, place]))
                path.write_text(json.dumps(cells, indent=1))


SHOWN = {"linear_stiffness": "k1", "cubic_stiffness": "k3", "linear_damping": "c1", "coulomb_friction": "M_F"}


def show(path, figure):
    """Print the cells, and draw them where a file for it is given; return a row for each choice of sensors."""
    cells = json.loads(Path(path).read_text())
    worst = np.full((len(SENSORS), len(NOISE)), np.nan)
    marks = np.full(worst.shape, "", dtype=object)
    for key, found in cells.items():
        name, noise = key.split(" | ")
        at = [*SENSORS].index(name), NOISE.index(float(noise))
        errors = [abs(found["errors"][term][0]) for term in SHOWN if term in found["errors"]]
        worst[at] = max(errors, default=np.nan)
        exact = set(found["terms"]) == set(TERMS)
        marks[at] = (f"{100 * worst[at]:.2g} %" if errors else "none") + (
            ("\nundecided" if found["verdict"] == "undecided" else "") if exact else "\nother terms"
        )
        numbers = ", ".join(
            f"{SHOWN[term]} {100 * error:+.2f} ± {100 * spread:.2f} %"
            for term, (error, spread) in found["errors"].items()
            if term in SHOWN
        )
        print(f"{key}: {found['verdict']}; {', '.join(found['terms'])}; {numbers}")
    if figure:
        draw(worst, marks, figure)
    return [_row(name, cells) for name in SENSORS]


def _row(name, cells):
    """Return the cells of some sensors by noise, and how many of their 95 % intervals hold the truth."""
    found = {noise: cells[f"{name} | {noise:g}"] for noise in NOISE if f"{name} | {noise:g}" in cells}
    numbers = [number for cell in found.values() for number in cell["errors"].values()]
    held = sum(abs(error) <= 1.96 * spread for error, spread in numbers)
    row = dict(sensors=name, held=held, of=len(numbers))
    for place, cell in enumerate(found.values()):
        worst = max(
            (abs(cell["errors"][term][0]) for term in SHOWN if term in cell["errors"]), default=np.nan
        )
        row[f"noise{place}"] = f"{100 * worst:.2g}" if {*cell["terms"]} == {*TERMS} else "other terms"
    return row


def draw(worst, marks, path):
    """Draw the grid: the largest error of k1, k3, c1 and M_F, and where other terms than the five were found."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.colors import LogNorm

    drawn, axes = plt.subplots(figsize=(7.2, 4.2), layout="constrained")
    image = axes.imshow(100 * worst, norm=LogNorm(0.1, 30), cmap="cividis_r", aspect="auto")
    for (row, column), text in np.ndenumerate(marks):
        value = 100 * worst[row, column]
        axes.text(column, row, text, ha="center", va="center", fontsize=9,
                  color="white" if value > 2 else "black")  # fmt: skip
    axes.set_xticks(range(len(NOISE)), [f"{100 * noise:g} %" for noise in NOISE])
    axes.set_yticks(range(len(SENSORS)), [*SENSORS])
    axes.set_xlabel("noise of each channel, of its RMS")
    axes.set_title("Largest error of k1, k3, c1 and M_F", fontsize=10)
    drawn.colorbar(image, label="largest error, %")
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    drawn.savefig(path, dpi=130)


def main():
    """Run or show."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("run").add_argument("--out", required=True)
    shown = verbs.add_parser("show")
    shown.add_argument("file")
    with_rows(shown).add_argument("--figure")
    given = parser.parse_args()
    if given.verb == "run":
        run(given.out)
    else:
        write_rows(given.json, show(given.file, given.figure))


if __name__ == "__main__":
    main()
