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


def commands(
    doc: str | None, run: Callable[..., None], show: Callable[..., None], **options: dict
) -> argparse.Namespace:
    """Return the parsed command line: ``run`` with options of its own, and ``show``."""
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
    showing.add_argument(
        "--json", type=Path, help="file for the figures of the guide's page, where the benchmark has it"
    )
    showing.set_defaults(do=show)
    return parser.parse_args()
