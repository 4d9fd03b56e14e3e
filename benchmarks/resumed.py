"""What the benchmarks of diagnosis share: a file of one line per campaign, which a run appends to and resumes."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from pathlib import Path


def records_in(paths: Iterable[str]) -> list[dict]:
    """Return the records of some files, in order; a file that is not there holds none."""
    files = [Path(path) for path in paths]
    return [json.loads(line) for file in files if file.exists() for line in file.read_text().splitlines()]


def done_in(path: str, keys: tuple[str, ...]) -> set[tuple]:
    """Return what a file holds already, as the values of its records' ``keys``."""
    return {tuple(record.get(key) for key in keys) for record in records_in([path])}


def append(path: str, record: dict) -> None:
    with Path(path).open("a") as file:
        file.write(json.dumps(record) + "\n")


def run_seeds(one: Callable[[int], dict], arguments: argparse.Namespace) -> None:
    """Append what is found of each seed, from the first one given up to the last, that the file lacks."""
    done = done_in(arguments.out, ("seed",))
    for seed in range(*arguments.seeds):
        if (seed,) not in done:
            append(arguments.out, one(seed))


def write_rows(path: Path | None, rows: list[dict]) -> None:
    """Write the rows of a table of the guide's page *Measured*, where a file for them is given."""
    if path:
        path.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def with_rows(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Return a parser with the option that names the file for ``write_rows``."""
    parser.add_argument("--json", type=Path, help="file for the rows of the guide's page")
    return parser


def seeds_of(records: list[dict]) -> str:
    """Return the seeds of some records in a few words."""
    seeds = sorted({record["seed"] for record in records})
    few, gaps = len(seeds) < 3, seeds[-1] - seeds[0] >= len(seeds)
    span = f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(map(str, seeds)) if few else f"{len(seeds)} of {span}" if gaps else span


def main(doc: str | None, run: Callable[..., None], show: Callable[..., list[dict]], **options: dict) -> None:
    """Do what the command line says: ``run`` with options of its own, or ``show``, which returns rows of the page."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    two = parser.add_subparsers(required=True)
    running = two.add_parser("run")
    running.add_argument("--out", required=True)
    running.add_argument("--names", nargs="*")
    running.add_argument("--seeds", nargs="+", type=int, default=[0, 1])
    for name, settings in options.items():
        running.add_argument(f"--{name.replace('_', '-')}", **settings)
    running.set_defaults(do=run)
    showing = two.add_parser("show")
    showing.add_argument("paths", nargs="+")
    with_rows(showing).set_defaults(do=lambda given: write_rows(given.json, show(given)))
    given = parser.parse_args()
    given.do(given)
