"""A model saved by a diagnosis, read again and verified: the gap on the runs kept out, beside that of the diagnosis.

python -m benchmarks round-trip --seeds 0 1               # virtual tests with hidden effects
python -m benchmarks round-trip --data ../shared/data     # public data
python -m benchmarks round-trip --names channel_delay jenkins_element --tests usual multisine

Every second run is kept out; of a campaign with one run its last third. model.json is written and read.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bench_diagnosis import TESTS  # noqa: E402
from benchmarks.resumed import with_rows, write_rows  # noqa: E402

ALLOWED = 0.02
COLUMNS = (
    "campaign", "verdict", "effects", "moment gap", "verified", "response gap", "verified", "difference", "seconds",
)  # fmt: skip


def part_of(run, first: int, last: int, name: str, use: str = "identify"):
    """Return some samples of a run as a run."""
    cut = slice(first, last)
    signals = {key: getattr(run, key) for key in ("moment", "angle", "rate", "valid")}
    kept = {key: None if values is None else values[cut] for key, values in signals.items()}
    return replace(run, name=name, use=use, source=None, **kept)


def with_runs_kept_out(campaign):
    """Return a campaign with every second run, or the last third of its only one, marked for validation."""
    if len(campaign.runs) == 1:
        (run,) = campaign.runs
        cut = 2 * run.n_samples // 3
        parts = (
            part_of(run, 0, cut, "first"),
            part_of(run, cut, run.n_samples, "last", "validate"),
        )
        return replace(campaign, runs=parts)
    return replace(
        campaign,
        runs=tuple(
            replace(run, use="validate" if i % 2 else "identify") for i, run in enumerate(campaign.runs)
        ),
    )


def saved_and_verified(campaign, folder: Path):
    """Return the diagnosis of a campaign, and the verification of the model that it saved."""
    from sindyjoint.workflows.diagnose import diagnose
    from sindyjoint.workflows.verify import verify

    accept = accepted(campaign)
    found = diagnose(campaign, accept=accept, advise=False)
    (folder / "model.json").write_text((found.whole or found.model).to_json())
    return found, verify(folder / "model.json", campaign, accept=accept, draws=0)


def accepted(campaign) -> tuple[str, ...]:
    """Return what the check of the data would stop at: here the figures are compared, whatever they are worth."""
    from sindyjoint.soundness.check import check_data

    return tuple(dict.fromkeys(f.id for f in check_data(campaign).stopping))


def row(name: str, campaign) -> tuple[list[str], float]:
    """Return the line of a campaign, and the larger relative difference; an error in the place of figures."""
    from sindyjoint.text import percent

    start = time.process_time()
    try:
        with tempfile.TemporaryDirectory() as folder:
            found, again = saved_and_verified(campaign, Path(folder))
    except Exception as error:  # a benchmark goes on, and says what failed
        return [name, f"{type(error).__name__}: {error}"[:90]], float("inf")
    pairs = ((found.final.moment, again.moment_nrmse), (found.final.response, again.response_nrmse))
    known = [(one, two) for one, two in pairs if one == one and two is not None]
    apart = max((abs(two / one - 1) for one, two in known), default=float("nan"))
    effects = " ".join(step.effect for step in found.steps) or "none"
    figures = [percent(value) for pair in pairs for value in pair]
    seconds = f"{time.process_time() - start:.0f}"
    return [name, found.verdict, effects, *figures, f"{100 * apart:.3g} %", seconds], apart


def campaigns(given: argparse.Namespace) -> Iterator[tuple[str, object]]:
    """Yield the campaigns that were asked for."""
    from sindyjoint.files import load_campaign

    if given.data is not None:
        for folder in sorted(path.parent for path in given.data.glob("*/campaign.toml")):
            if not given.names or folder.name in given.names:
                yield folder.name, load_campaign(folder)
        return
    from tests.diagnosis.hidden_effects import CHANNELS, LAWS, OUTSIDE, hide, hide_in_noise

    names = given.names or [n for n in (*LAWS, *CHANNELS, "nothing") if n not in OUTSIDE]
    for test in given.tests:
        for seed in given.seeds:
            for name in names:
                fixed = TESTS[test]
                if fixed is None and name in CHANNELS:
                    continue
                hidden = hide_in_noise(name, test, seed) if fixed is None else hide(name, seed, **fixed)
                yield f"{name} {seed} {test} {hidden.plan.drive}", hidden.campaign


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, a line as soon as its campaign is done; exit status 1 where one differs by more than 2 %."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks round-trip",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, help="folder that holds public sets; default: virtual tests")
    parser.add_argument("--names", nargs="*", help="effects, or sets")
    parser.add_argument("--seeds", nargs="*", type=int, default=[0])
    parser.add_argument("--tests", nargs="*", choices=TESTS, default=["usual"])
    given = with_rows(parser).parse_args(arguments)
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    differences = []
    for name, campaign in campaigns(given):
        cells, apart = row(name, with_runs_kept_out(campaign))
        differences.append(apart)
        print("| " + " | ".join(cells) + " |", flush=True)
    within = sum(apart <= ALLOWED for apart in differences)
    known = [apart for apart in differences if apart < float("inf")]
    kind = "virtual campaigns" if given.data is None else "public sets"
    refused = len(differences) - len(known)
    write_rows(given.json, [dict(campaigns=kind, of=len(known), largest=max(known), refused=refused)])
    print(f"\nwithin {100 * ALLOWED:g} %: {within} of {len(differences)}")
    raise SystemExit(0 if within == len(differences) else 1)


if __name__ == "__main__":
    main()
