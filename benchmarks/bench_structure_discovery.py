"""The law of joints inside a structure from its accelerometers, over random joints.

    python benchmarks/bench_structure_discovery.py run --seeds 1 41 --out laws.jsonl
    python benchmarks/bench_structure_discovery.py run --rig four-panel-wing --drive multisine --wrong --out laws.jsonl
    python benchmarks/bench_structure_discovery.py show laws.jsonl

Each seed draws k1, k2, k3, c1, M_F of every kind of joint within 20 % of the paper's, drives the structure at forces
found by trial simulations, and discovers the laws from accelerometers and a force cell with 1 % noise. Runs of 20 s
that repeat are simulated for 5 s (multisines 2 s) once they are steady, and these repeated with noise of their own.
`--wrong`: the beams' stiffness is 1 % and their mass 0.5 % (standard deviations, one number each) other than the file
says, and the file says that it may be. `--untold`: the beams are 5 % stiffer, and the file says nothing.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in, seeds_of
from sindyjoint.errors import SimulationError, SindyJointError
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.rig_test import RigTest, Sensor, uncertain_numbers
from sindyjoint.mechanics.rigs import load_rig
from sindyjoint.mechanics.sensors import Channel
from sindyjoint.mechanics.structure import Hinge, assemble
from sindyjoint.mechanics.virtual_rig import Drive, Recorder, simulate_run
from sindyjoint.paper import TERMS

STATIONS = {
    "pulse-rig": {"a": ("lower beam", 0.3), "b": ("lower beam", 0.5), "c": ("upper beam", 0.15),
                  "d": ("upper beam", 0.35), "e": ("upper beam", 0.5)},
    "four-panel-wing": {f"{panel} {at}": (f"panel {panel}", at) for panel in range(1, 5) for at in (0.45, 1.0)},
}  # fmt: skip
# Frequencies, Hz, and the force, N, at which the paper's joints come near the wanted angle.
SINES = {
    "pulse-rig": {3.0: 4.4, 3.6: 2.6, 5.2: 5.2, 6.0: 10.0},
    "four-panel-wing": {1.2: 0.92, 4.4: 3.4, 5.4: 2.4, 6.4: 6.5},
}
BANDS = {"pulse-rig": (2.0, 12.0), "four-panel-wing": (1.0, 9.0)}  # of a sweep
# The mode that moves the joints: on the wing the outer ones slip in the second and not in the first. A multisine has
# lines from 0.8 of its frequency with joints that slip, as they soften, to that with joints that stick.
MODE, BELOW = {"pulse-rig": 1, "four-panel-wing": 2}, 0.8
FIRST_MULTISINE = {"pulse-rig": 2.5, "four-panel-wing": 3.0}  # N, of a trial
SPACING, REALISATIONS = 0.5, 3  # Hz; random phases of each multisine
STRIKE = 0.03  # s, of an impact
STRETCH = {"sine": 5.0, "multisine": 2.0}  # s, whole periods of what repeats
LEVELS = (1.0, 0.87, 0.75)
LARGEST = 0.6  # of the softening limit
LARGEST_MULTISINE = 0.75  # which comes near its largest angle a few times in a period
DRIVES = {"sine": "12 sines", "multisine": "3 multisines", "sweep": "6 sweeps", "impact": "6 blows"}
NAMES = ("k1", "k2", "k3", "c1", "M_F")
UNTOLD = (1.05, 1.0)  # stiffness and mass of beams of which the file says nothing


def with_random_laws(rig, generator):
    """Return a rig whose kinds of joint have random laws, and these laws by kind."""
    laws = {}
    for item in rig.items:
        if isinstance(item, Hinge) and item.law.name not in laws:
            drawn = {name: getattr(item.law, name) * generator.uniform(0.8, 1.2) for name in NAMES}
            laws[item.law.name] = replace(item.law, **drawn)
    items = tuple(replace(i, law=laws[i.law.name]) if isinstance(i, Hinge) else i for i in rig.items)
    return replace(rig, items=items), laws


def with_other_beams(rig, stiffness, mass):
    """Return a rig whose beams are stiffer and heavier by factors."""
    items = tuple(
        replace(i, bending_stiffness=i.bending_stiffness * stiffness, mass_per_length=i.mass_per_length * mass)
        if isinstance(i, Beam) else i for i in rig.items
    )  # fmt: skip
    return replace(rig, items=items)


def largest_share(structure, at, sensors, drive, recorder, phases):
    """Return the largest joint angle as a share of its softening limit; infinite where it is passed."""
    # A sweep has to pass the resonance; what a blow does shows at once.
    seconds = recorder.duration if drive.shape == "sweep" else 3.0
    quick = replace(recorder, duration=seconds, settling=5.0, noise=0.0, step=5e-4)
    try:
        _, response = simulate_run(structure, at, sensors, drive, quick, np.random.default_rng(phases))
    except SimulationError:
        return np.inf
    limits = [min(map(abs, hinge.law.softening_limit)) for hinge in structure.hinges]
    return max(np.abs(angle).max() / limit for angle, limit in zip(response.angle, limits, strict=True))


def find_force(structure, at, sensors, drive, recorder, start, wanted=LARGEST, phases=0):
    """Return the force at which the largest joint angle is about the wanted share of its softening limit."""
    low, high, force = 0.0, np.inf, start
    for _ in range(9):
        share = largest_share(structure, at, sensors, replace(drive, amplitude=force), recorder, phases)
        if 0.85 * wanted < share < wanted:
            break
        low, high = (force, high) if share < wanted else (low, force)
        middle = (low + high) / 2 if np.isfinite(high) else 1.6 * force
        guess = 0.93 * wanted / share * force if np.isfinite(share) else middle
        force = guess if low < guess < min(high, 2 * force) else middle
    return force if share < wanted else low


def drives_of(name, structure, at, sensors, recorder, kind):
    """Return twelve sines, three multisines, six sweeps or six blows."""
    drives = []
    if kind == "sine":
        for frequency, start in SINES[name].items():
            drive = Drive("trial", "sine", 1.0, frequency)
            top = find_force(structure, at, sensors, drive, recorder, start)
            drives += [
                Drive(f"{frequency:g} Hz {level:g}", "sine", level * top, frequency, level=f"{level:g}")
                for level in LEVELS
            ]
        return drives
    if kind in ("sweep", "impact"):
        band, width = (BANDS[name], None) if kind == "sweep" else (None, STRIKE)
        drive = Drive("trial", kind, 1.0, band=band, width=width)
        top = find_force(structure, at, sensors, drive, recorder, 1.5 if kind == "sweep" else 20.0)
        return [
            replace(drive, name=f"{kind} {level:g} {again}", amplitude=level * top, level=f"{level:g}")
            for level in LEVELS
            for again in (1, 2)
        ]
    band = band_of(structure, MODE[name])
    drive = Drive("trial", "multisine", 1.0, SPACING, band)
    drives, top = [], FIRST_MULTISINE[name]
    for number in range(REALISATIONS):
        # Every run has phases of its own, and its force is found with these.
        top = find_force(structure, at, sensors, drive, recorder, top, LARGEST_MULTISINE, number)
        drives.append(replace(drive, name=f"multisine {number}", level=str(number), amplitude=top))
    return drives


def band_of(structure, mode):
    """Return the frequencies between which a mode lies that slips and softens, or sticks, Hz."""
    slipping, sticking = (structure.frequencies(mode, locked=locked)[-1] for locked in (False, True))
    return BELOW * float(slipping), float(sticking)


def recorded(test, drives, recorder, kind, generator):
    """Return a test with its runs; of what repeats a stretch is simulated."""
    stretch = STRETCH.get(kind, recorder.duration)
    quick = replace(recorder, noise=0.0, duration=stretch)
    exact = [
        simulate_run(test.structure, test.at, test.sensors, drive, quick, np.random.default_rng(phases))[0]
        for phases, drive in enumerate(drives)
    ]
    channel, times = Channel(noise=recorder.noise), round(recorder.duration / stretch)

    def shown(signal):
        return channel.read(np.tile(signal, times), generator)

    runs = tuple(
        replace(run, drive=shown(run.drive), responses=np.array([shown(s) for s in run.responses]))
        for run in exact
    )
    return replace(test, runs=runs, simulated=True)


def campaign(name, seed, kind="sine", wrong=False):
    """Return a virtual test of a rig with random joints as its file describes it, and the laws by kind."""
    generator = np.random.default_rng(seed)
    rig, laws = with_random_laws(load_rig(name), generator)
    factors = UNTOLD if wrong == "untold" else 1 + generator.normal(size=2) * (0.01, 0.005) * wrong
    described = assemble(rig.items, rig.clamp_stiffness, STATIONS[name])
    described = replace(described, loss_frequency=float(described.frequencies(1)[0]))
    true = replace(
        assemble(with_other_beams(rig, *factors).items, rig.clamp_stiffness, STATIONS[name]),
        loss_frequency=described.loss_frequency,
    )
    sensors = tuple(Sensor(station, station) for station in STATIONS[name])
    kinds = tuple(hinge.law.name for hinge in true.hinges)
    # At the default step the midpoint rule errs by 0.1 % at 70 Hz. Updated numbers of a structure show that: of four,
    # χ² is then 60 from the truth without noise, 3.7 at half the step, 0.3 at a quarter.
    # Sweeps and blows show it, too: steps of 0.25 ms move k1 and c1 by 0.03 and 0.1 % (one campaign without noise).
    passing = kind in ("sweep", "impact")
    recorder = Recorder(noise=0.01, step=3.2e-5 if passing else 6.25e-5 if wrong else 1.25e-4)
    drives = drives_of(name, true, "tip", sensors, recorder, kind)
    test = RigTest(name, true, kinds, "tip", sensors, ())
    test = recorded(test, drives, recorder, kind, generator)
    stated = {item.name: {"stiffness": 0.01, "mass": 0.005} for item in rig.items if isinstance(item, Beam)}
    uncertain = uncertain_numbers(rig.items, rig.clamp_stiffness, stated) if wrong is True else ()
    return replace(test, structure=described, uncertain=uncertain), laws, factors


def one(name, seed, kind, wrong, refine=None):
    """Return what was found of one campaign."""
    from sindyjoint.workflows.discover import discover_rig

    begun = time.perf_counter()
    test, laws, factors = campaign(name, seed, kind, wrong)
    made = time.perf_counter()
    result = discover_rig(test, random_state=seed, refine=refine)
    record = {
        "seed": seed,
        "simulated": made - begun,
        "seconds": time.perf_counter() - made,
        "factors": [*factors],
    }
    if result.refinement is not None:
        record["refinement"] = {
            name: getattr(result.refinement, name) for name in ("refined", "reason", "before", "after")
        }
    record |= {"kinds": {}, "update": None if result.update is None else result.update.change.tolist()}
    for found in result.laws:
        truth = dict(zip(TERMS, (getattr(laws[found.kind], n) for n in NAMES), strict=True))
        model = None if found.discovery is None else found.discovery.model
        record["kinds"][found.kind] = {
            "reason": found.reason,
            "verdict": None if model is None else found.discovery.verdict.verdict,
            "terms": [] if model is None else list(model.ids),
            "numbers": {} if model is None else {
                term.id: [term.coefficient, term.standard_error, *term.interval95, truth[term.id]]
                for term in model.terms if term.id in truth
            },
        }  # fmt: skip
    return record


def title(given):
    """Return how the guide's page calls these campaigns."""
    wrong = {True: ", beams 1 % and mass 0.5 % wrong", "untold": ", beams 5 % stiffer than stated"}
    refined = {True: ", refined", False: ", by regression"}
    return f"{given.rig}, {DRIVES[given.drive]}{wrong.get(given.wrong, '')}{refined.get(given.refine, '')}"


def run(given):
    """Append what is found of each campaign that the file lacks."""
    said, done = title(given), done_in(given.out, ("test", "seed"))
    for seed in range(*given.seeds):
        if (said, seed) in done:
            continue
        try:
            found = one(given.rig, seed, given.drive, given.wrong, given.refine)
        except SindyJointError as error:
            found = {"seed": seed, "error": str(error), "kinds": {}}
        append(given.out, {"test": said} | found)


def show(given) -> list[dict]:
    """Print exact sets, undecided ones, relative RMS error and coverage; return them."""
    records = records_in(given.paths)
    return [
        row(test, [r for r in records if r["test"] == test])
        for test in dict.fromkeys(r["test"] for r in records)
    ]


def row(test, campaigns):
    """Print the figures of campaigns of one kind, and return their row of the guide's page."""
    made = [record for record in campaigns if "error" not in record]
    print(f"{test}: {len(campaigns)} campaigns, failed: {[r['seed'] for r in campaigns if 'error' in r]}")
    laws = [law for record in made for law in record["kinds"].values()]
    exact = [all(set(TERMS) == set(k["terms"]) for k in r["kinds"].values()) for r in made]
    print(f"exact set: {sum(exact)}, not of {[r['seed'] for r, ok in zip(made, exact, strict=True) if not ok]}; "
          f"undecided laws {sum(law['verdict'] in (None, 'undecided') for law in laws)} of {len(laws)}")  # fmt: skip
    held, errors = [], []
    for term, name in zip(TERMS, NAMES, strict=True):
        rows = np.array([law["numbers"][term] for law in laws if term in law["numbers"]]).reshape(-1, 5)
        inside, error = (rows[:, 2] <= rows[:, 4]) & (rows[:, 4] <= rows[:, 3]), rows[:, 0] / rows[:, 4] - 1
        held += inside.tolist()
        errors.append(f"{100 * np.sqrt(np.mean(error**2)):.2g}")
        print(
            f"{name:4s} RMS {errors[-1]} %, mean {error.mean():+.2%}, held {inside.mean():.1%} of {inside.size}"
        )
    seconds = float(np.median([record["seconds"] for record in made]))
    print(f"intervals hold {np.mean(held):.1%} of {len(held)}; discovery {seconds:.1f} s in the median")
    return dict(
        test=test, seeds=seeds_of(campaigns), exact=sum(exact), of=len(campaigns), held=sum(held),
        intervals=len(held), errors=errors, seconds=seconds,
    )  # fmt: skip


if __name__ == "__main__":
    main(
        __doc__, run, show,
        rig=dict(choices=[*STATIONS], default="pulse-rig"), drive=dict(choices=[*DRIVES], default="sine"),
        wrong=dict(action="store_true"), untold=dict(dest="wrong", action="store_const", const="untold"),
        refine=dict(action=argparse.BooleanOptionalAction),
    )  # fmt: skip
