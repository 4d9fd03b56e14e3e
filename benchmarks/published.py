"""The field's benchmarks by their own protocols: the official training part, a free run of the official test.

python benchmarks/published.py DATA
python benchmarks/published.py DATA --only emps --json published.json

DATA holds what a user has downloaded, a folder for each set: ``emps`` with DATA_EMPS.mat and DATA_EMPS_PULSES.mat,
``silverbox`` with SNLS80mV.mat, ``bouc-wen`` with a record of its simulator (multisine_train.csv) and the hidden tests
(uval_multisine.mat, yval_multisine.mat, ...); and, without an official test, ``pendulum`` and ``friction-damper`` with
a campaign.toml. Nothing is fetched or copied. The initial state is estimated on the first n samples, the error is that
of all others. Where the file of a test is absent, that is said, and the end of the training part, left out of the
training, takes its place.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bench_round_trip import part_of, with_runs_kept_out  # noqa: E402

COLLECTION = "nonlinearbenchmark.org"
BASELINES = "[C]"  # Champneys et al. 2024 (arXiv 2405.10779)


@dataclass(frozen=True)
class Benchmark:
    """A set and its protocol.

    Parameters
    ----------
    name : str
        Its folder.
    door : {"discover", "diagnose"}
        What finds the law; its numbers are then refined on the simulated response.
    initial : tuple of int
        Samples on which the initial state is estimated.
    train : callable
        From the folder to the campaign of the official training part.
    tests : dict of str to callable
        From the folder to each official test as a campaign.
    held_out : callable
        From the training campaign to one with a part of it marked for validation.
    published : dict of str to str
        Figures of others for each test.
    size, unit : float and str
        Of the figures, in the channel's SI.
    """

    name: str
    door: str
    initial: tuple[int, ...]
    train: Callable
    tests: dict[str, Callable]
    held_out: Callable
    published: dict[str, str]
    size: float
    unit: str


@dataclass(frozen=True)
class Figure:
    """One figure: of which test, after how many samples, by which law, beside whose."""

    benchmark: str
    test: str
    official: bool
    initial: int
    model: str
    terms: tuple[str, ...]
    rmse: float | None
    nrmse: float | None
    noise: float | None
    unit: str
    published: str
    seconds: float


def last(share: float) -> Callable:
    """Return a split that holds out the last share of the only run."""

    def split(campaign):
        (run,) = campaign.runs
        cut = round((1 - share) * run.n_samples)
        parts = (part_of(run, 0, cut, "first"), part_of(run, cut, run.n_samples, "last", "validate"))
        return replace(campaign, runs=parts)

    return split


def slide(name: str, force, displacement, rate: float):
    """Return a campaign of one run of a joint that slides."""
    from sindyjoint import Campaign

    signals = {"force": np.ravel(force), "displacement": np.ravel(displacement)}
    return Campaign.from_arrays(**signals, rate=rate, frequency=None, name=name)


def matrices(*files: Path) -> dict:
    """Return what some files of MATLAB hold."""
    from scipy.io import loadmat

    for file in files:
        if not file.is_file():
            raise FileNotFoundError(2, "absent", str(file))
    return {key: value for file in files for key, value in loadmat(file).items()}


def emps(file: str) -> Callable:
    """Return how a record of the positioning system is read: gtau N/V make a force of the voltage."""

    def read(folder: Path):
        held = matrices(folder / file)
        return slide("EMPS drive", held["gtau"].item() * held["vir"], held["qm"], 1000.0)

    return read


# Parts of the official record: arrows first, then ten multisines, of which three quarters are for training.
MULTISINES, TRAINING = slice(40_650, 127_400), 65_062


def silverbox(part: Callable, spare: str = "") -> Callable:
    """Return how a part of the official record is read; from a file of its own where the record is absent."""

    def read(folder: Path):
        if spare and not (folder / "SNLS80mV.mat").is_file():
            _, u, y = np.loadtxt(folder / spare, delimiter=",", skiprows=1).T
        else:
            held = matrices(folder / "SNLS80mV.mat")
            u, y = part(np.ravel(held["V1"])), part(np.ravel(held["V2"]))
        return slide("Silverbox", u, y, 1e7 / 2**14)

    return read


def bouc_wen_test(name: str) -> Callable:
    """Return how a hidden test of the hysteretic oscillator is read."""

    def read(folder: Path):
        files = [folder / f"{channel}val_{name}.mat" for channel in "uy"]
        held = matrices(*files)
        return slide("Bouc-Wen oscillator", *(held[file.stem] for file in files), 750.0)

    return read


def described(folder: Path):
    """Return the campaign that a manifest describes."""
    from sindyjoint.files import load_campaign

    return load_campaign(folder)


SETS = (
    Benchmark(
        "emps", "discover", (20, 100), emps("DATA_EMPS.mat"), {"pulses": emps("DATA_EMPS_PULSES.mat")}, last(1 / 3),
        {"pulses": f"5.17 (best), 5.5 (linear) {BASELINES}; 9.7 (owners)"},
        1e3, "mm",
    ),
    Benchmark(
        "silverbox", "discover", (50,),
        silverbox(lambda v: v[MULTISINES][:TRAINING], "multisine_train.csv"),
        {
            "multisine": silverbox(lambda v: v[MULTISINES][TRAINING:]),
            "arrow": silverbox(lambda v: v[100:40_575]),
            "arrow, no extrapolation": silverbox(lambda v: v[100:32_100]),
        },
        last(1 / 3),
        {
            "multisine": f"0.301 (best) {BASELINES}",
            "arrow": f"0.60 (best) {BASELINES}",
            "arrow, no extrapolation": f"0.259 (best) {BASELINES}",
        },
        1e3, "mV",
    ),
    Benchmark(
        "bouc-wen", "diagnose", (50,), described,
        {name: bouc_wen_test(name) for name in ("multisine", "sinesweep")}, last(1 / 5),
        dict.fromkeys(("multisine", "sinesweep"), f"0.0187 (best), tests without noise: {COLLECTION}"), 1e3, "mm",
    ),
    Benchmark(
        "pendulum", "discover", (1000,), described, {}, last(1 / 2),
        {"second half": "1.9 % over 18 s ahead: Kaheman et al. 2022"},
        1e3, "mrad",
    ),
    Benchmark(
        "friction-damper", "diagnose", (300,), described, {}, with_runs_kept_out,
        {"other runs": "force 11 % of the run fitted: Coble et al. 2022"},
        1.0, "kip",
    ),
)  # fmt: skip


def found_law(campaign, door: str, refine: bool, folder: Path) -> tuple[str, ...]:
    """Write the model that a door finds in a campaign; return its terms and elements."""
    if door == "discover":
        from sindyjoint import discover
        from sindyjoint.judgement.discovery import refined

        found = discover(campaign, align=True)
        model = (refined(found) if refine else found).model
    else:
        from sindyjoint import diagnose

        answer = diagnose(campaign, advise=False, refine=refine)
        model = answer.whole or answer.model
    (folder / "model.json").write_text(model.to_json())
    return (*model.ids, *(each.id for each in model.elements))


def figures(each: Benchmark, data: Path, refine: bool) -> list[Figure]:
    """Return the figures of one set, of its official tests or of what is held out in their place."""
    from sindyjoint.workflows.verify import verify

    begin, source = time.process_time(), data / each.name
    train = each.train(source)
    tests = {}
    for name, read in each.tests.items():
        try:
            tests[name] = read(source)
        except FileNotFoundError as error:
            print(f"{each.name}, {name}: {Path(error.filename or '').name} is absent", file=sys.stderr)
    official, published = bool(tests), each.published
    if not official:
        train = each.held_out(train)
        tests = {"held out": train}
        words = "official test: " if each.tests else ""
        published = {"held out": words + next(iter(published.values()))}
    found = []
    with tempfile.TemporaryDirectory() as folder:
        terms = found_law(train, each.door, refine, Path(folder))
        for name, test in tests.items():
            for initial in each.initial:
                answer = verify(Path(folder) / "model.json", test, draws=0, free_run=initial)
                rmse = [run.rmse for run in answer.runs]
                single = len(rmse) == 1 and rmse[0] is not None
                found.append(
                    Figure(
                        each.name, name, official, initial, each.door + " --refine" * refine, terms,
                        each.size * rmse[0] if single else None, answer.response_nrmse, answer.noise_floor,
                        each.unit, published[name],
                        round(time.process_time() - begin, 1),
                    )
                )  # fmt: skip
    return found


def line(figure: Figure) -> str:
    """Return a figure as a line of a table."""
    from sindyjoint.text import percent

    cells = (
        figure.benchmark,
        figure.test,
        f"{figure.initial}",
        figure.model,
        "" if figure.rmse is None else f"{figure.rmse:.3g} {figure.unit}",
        percent(figure.nrmse),
        percent(figure.noise),
        figure.published,
        f"{figure.seconds:.0f}",
        " ".join(figure.terms),
    )
    return f"| {' | '.join(cells)} |"


COLUMNS = (
    "set",
    "test",
    "n",
    "model",
    "RMSE",
    "NRMSE",
    "noise",
    "published",
    "seconds",
    "terms and elements",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, lines as soon as their set is done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder that holds a folder for each set")
    parser.add_argument("--only", nargs="*", choices=[each.name for each in SETS], help="names of sets")
    parser.add_argument(
        "--plain", action="store_true", help="without the refinement on the simulated response"
    )
    parser.add_argument("--json", type=Path, help="file for all figures")
    given = parser.parse_args(arguments)
    chosen = [each for each in SETS if not given.only or each.name in given.only]
    here = [each for each in chosen if (given.data / each.name).is_dir()]
    if not here:
        parser.error(f"{given.data} holds none of {', '.join(each.name for each in chosen)}")
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    made = []
    for each in here:
        for figure in figures(each, given.data, not given.plain):
            made.append(figure)
            print(line(figure), flush=True)
    if given.json:
        given.json.write_text(json.dumps([asdict(figure) for figure in made], indent=1) + "\n")


if __name__ == "__main__":
    main()
