"""Public data in the metric of those who published them: a model from each door, saved, read, and simulated freely.

python -m benchmarks public --data ../shared/data
python -m benchmarks public --data ../shared/data --only emps --doors discover refined

Each set is fitted and judged as said in its line: on samples that no fit saw, or in-sample. Published figures are those
that the set's owners, or the reports on it, state; they are of the official test parts, which are not read here.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bench_round_trip import part_of, with_runs_kept_out  # noqa: E402

COLUMNS = (
    "set",
    "told on",
    "door",
    "terms and elements",
    "RMSE",
    "NRMSE",
    "noise",
    "published",
    "source",
    "seconds",
)


@dataclass(frozen=True)
class PublicSet:
    """How one set is told.

    Parameters
    ----------
    name : str
        Folder.
    told : str
        On what the figure is told.
    split : callable
        From the campaign to one whose runs for validation are told of; without any it is in-sample.
    free_run : int
        Samples from which the initial state is estimated.
    published, source : str
    period : int
        Samples after which the record repeats, by which its noise is measured; 0: it does not.
    """

    name: str
    told: str
    split: Callable
    free_run: int
    published: str
    source: str
    period: int = 0


def last(share: float) -> Callable:
    """Return a split that keeps the last share of the only run."""

    def split(campaign):
        (run,) = campaign.runs
        cut = round((1 - share) * run.n_samples)
        parts = (part_of(run, 0, cut, "first"), part_of(run, cut, run.n_samples, "last", "validate"))
        return replace(campaign, runs=parts)

    return split


SETS = (
    PublicSet(
        "silverbox", "last third, not fitted", last(1 / 3), 100,
        "0.945 mV (test multisine), fitted by simulation", "nonlinearbenchmark.org; Wigren, Schoukens 2013",
    ),
    PublicSet(
        "emps", "in-sample, all of the record", lambda campaign: campaign, 200,
        "in-sample: 7.5 mm with the owners' four parameters, refitted 6.1 mm",
        "Janot, Gautier, Brunot 2019, simulated",
    ),
    PublicSet(
        "emps", "last third, not fitted", last(1 / 3), 200, "none for this part", "",
    ),
    PublicSet(
        "bouc-wen", "last of five periods, not fitted", last(1 / 5), 1000,
        "0.0187 mm (test multisine, without noise), best", "nonlinearbenchmark.org; Noël, Schoukens 2016", 8192,
    ),
    PublicSet(
        "pendulum", "second half of the swing, not fitted", last(1 / 2), 1000,
        "NRMSE 0.019 over 18 s ahead (viscous, Coulomb, quadratic damping), viscous alone 0.20",
        "notes on the data of Kaheman et al. 2022",
    ),
    PublicSet(
        "friction-damper", "every second run, not fitted", with_runs_kept_out, 300,
        "force NRMSE 0.111, fitted to the one run told (0.5 Hz, 1 inch)",
        "friction in series with a gap; notes on the data of Coble et al. 2022",
    ),
)  # fmt: skip


def by_discovery(campaign, folder: Path) -> str:
    """Write the model that discovery finds."""
    from sindyjoint import discover

    model = discover(campaign).model
    (folder / "model.json").write_text(model.to_json())
    return " ".join(model.ids)


def by_refinement(campaign, folder: Path) -> str:
    """Write the same model, its coefficients refined on the simulated response."""
    from sindyjoint import discover
    from sindyjoint.response.refine import refine

    model = refine(discover(campaign).model, campaign).model
    (folder / "model.json").write_text(model.to_json())
    return " ".join(model.ids)


def by_diagnosis(campaign, folder: Path, refine: bool = False) -> str:
    """Write the model of a diagnosis with what belongs to the test."""
    from sindyjoint.workflows.diagnose import diagnose

    found = diagnose(campaign, advise=False, refine=refine)
    model = found.whole or found.model
    (folder / "model.json").write_text(model.to_json())
    return " ".join([*model.ids, *(each.id for each in model.elements)])


DOORS = {
    "discover": by_discovery,
    "refined": by_refinement,
    "diagnose": by_diagnosis,
    "diagnose-refined": partial(by_diagnosis, refine=True),
}


def rows(each: PublicSet, data: Path, door: str) -> list[list[str]]:
    """Return a line for all runs, and one for each where there are several."""
    from sindyjoint.errors import SindyJointError
    from sindyjoint.files import load_campaign
    from sindyjoint.text import percent
    from sindyjoint.workflows.verify import verify

    start = time.process_time()
    campaign = load_campaign(data / each.name)
    noise = repetition_noise(campaign.runs[0], each.period) if each.period else None
    campaign = each.split(campaign)
    head = [each.name, each.told, door]
    try:
        with tempfile.TemporaryDirectory() as folder:
            names = DOORS[door](campaign, Path(folder))
            found = verify(Path(folder) / "model.json", campaign, draws=0, free_run=each.free_run)
    except SindyJointError as error:
        return [[*head, f"{error}"[:80]]]
    seconds = f"{time.process_time() - start:.0f}"
    lines = []
    for run in found.runs:
        unit = run.rmse_unit
        size, shown = (1e3, f"m{unit}") if unit in ("V", "m") else (1.0, unit)
        rmse = "failed" if run.rmse is None else f"{size * run.rmse:.4g} {shown}"
        floor = f"{percent(run.noise_floor)}"
        if noise is not None and run.scale:
            floor = f"{percent(noise / run.scale)} by repetition"
        lines.append([*head, run.name, rmse, percent(run.response_nrmse), floor, "", "", ""])
    if len(lines) > 1:
        lines.append(
            [*head, "all runs", "", percent(found.response_nrmse), percent(found.noise_floor), "", "", ""]
        )
    lines[-1][3] = names
    lines[-1][7:] = [each.published, each.source, seconds]
    return lines


def repetition_noise(run, period: int) -> float:
    """Return the RMS of what does not repeat from period to period, of a single sample, SI."""
    periods = run.angle[: run.n_samples // period * period].reshape(-1, period)[1:]
    return float(np.sqrt(np.mean(np.var(periods, axis=0, ddof=1))))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, lines as soon as their set is done."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks public",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the sets")
    parser.add_argument("--only", nargs="*", help="names of sets")
    parser.add_argument("--doors", nargs="*", choices=DOORS, default=list(DOORS))
    given = parser.parse_args(arguments)
    chosen = [each for each in SETS if not given.only or each.name in given.only]
    here = [each for each in chosen if (given.data / each.name / "campaign.toml").is_file()]
    if not here:
        parser.error(f"{given.data} holds none of {', '.join(dict.fromkeys(each.name for each in chosen))}")
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    for each in here:
        for door in given.doors:
            for line in rows(each, given.data, door):
                print("| " + " | ".join(line) + " |", flush=True)


if __name__ == "__main__":
    main()
