"""The tests with the versions that are installed here: one row of the matrix of versions.

python benchmarks/versions.py --out benchmarks/results/versions.json tests/cli tests/discovery tests/reporting

A row of the same versions is replaced. The environments: ``uv pip install --resolution lowest-direct`` has the oldest
versions, as in ``.ci/run``; a Python of the next Debian release stands in a bare root (``debootstrap``, with ``/proc``
mounted).
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
from collections import Counter
from importlib.metadata import version
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

NAMES = ("numpy", "scipy", "scikit-learn", "pysindy")


class Outcomes:
    """Counts how tests end."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count the call of a test, and what ends before or after it."""
        if report.when == "call" or report.outcome != "passed":
            self.count["expected failures" if hasattr(report, "wasxfail") else report.outcome] += 1


def main() -> None:
    """Run, and write the row."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("tests", nargs="+")
    given = parser.parse_args()
    outcomes = Outcomes()
    status = pytest.main(["-n", "0", "-p", "no:cacheprovider", *given.tests], plugins=[outcomes])
    if not outcomes.count["passed"]:
        raise SystemExit(status or 1)
    versions = {"python": platform.python_version(), **{name: version(name) for name in NAMES}}
    rows = json.loads(given.out.read_text()) if given.out.exists() else []
    rows = [row for row in rows if any(row[name] != versions[name] for name in versions)]
    ended = {name: outcomes.count[name] for name in ("passed", "failed", "skipped", "expected failures")}
    rows.append(versions | {"tests": [name.removeprefix("tests/") for name in given.tests]} | ended)
    given.out.write_text(json.dumps(rows, indent=1) + "\n")
    raise SystemExit(status)


if __name__ == "__main__":
    main()
