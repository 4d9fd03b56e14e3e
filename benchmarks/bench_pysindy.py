"""The same virtual campaigns through plain ``pysindy.SINDy`` and through sindyjoint, side by side.

    python benchmarks/bench_pysindy.py --seeds 20 --noise 0.001 0.01 0.05 --json pysindy.json

Everyone gets the same candidates (the ``extended`` library), the true inertia, and the same runs. The columns:

plain       pysindy as it comes: measured angle, its own differentiation, candidates in SI units, default STLSQ
smooth      the same with its SmoothedFiniteDifference
states      default STLSQ on sindyjoint's force states: exact derivatives, sticking left out, SI units
scaled      the same with RMS-scaled candidates (TermLibrary as it comes)
oracle      the same, and the best of 31 thresholds picked by someone who knows the answer
plugged     pysindy with TermLibrary and UniqueShareSTLSQ on the same force states, with the labels of their rows
bare        the same without any label: pysindy hands none on, and the optimizer cuts the rows into segments
sindyjoint  ``discover`` as it comes
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import with_rows, write_rows  # noqa: E402
from sindyjoint.paper import TERMS  # noqa: E402

THRESHOLDS = np.geomspace(1e-3, 1.0, 31)


def plain(campaign: Any, method: Callable[[], Any]) -> tuple[list, list]:
    """Return (angle, rate) and the transfer moment of every run as pysindy's differentiation gives them."""
    states, moments = [], []
    for run in campaign.runs:
        rate = np.asarray(method()._differentiate(run.angle[:, None], run.time))
        acceleration = np.asarray(method()._differentiate(rate, run.time))
        states.append(np.column_stack([run.angle, rate[:, 0]]))
        moments.append((run.moment - campaign.joint.inertia * acceleration[:, 0])[:, None])
    return states, moments


def moving(campaign: Any) -> tuple[list, list]:
    """Return the same from sindyjoint's force states."""
    from sindyjoint.states import campaign_states

    states, moments = [], []
    for state in campaign_states(campaign):
        keep = state.moving
        states.append(np.column_stack([state.angle, state.rate])[keep])
        moments.append(state.transfer_moment(campaign.joint.inertia)[keep, None])
    return states, moments


def terms_of(data: tuple[list, list], scale: str | None) -> set[str]:
    """Return the terms that pysindy keeps with its default optimiser."""
    import pysindy

    from sindyjoint import TermLibrary

    states, moments = data
    times = [np.arange(len(x)) * 1e-3 for x in states]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = pysindy.SINDy(feature_library=TermLibrary("extended", scale=scale))
        model.fit(states, times, x_dot=moments)
    names = model.feature_library.get_feature_names()
    return {name for name, c in zip(names, model.coefficients()[0], strict=True) if c}


def best_of_thresholds(data: tuple[list, list]) -> set[str]:
    """Return the five terms if any threshold gives them and nothing else; the loosest answer if none does."""
    import pysindy

    from sindyjoint import TermLibrary

    states, moments = (np.vstack(part) for part in data)
    library = TermLibrary("extended").fit(states)
    columns, names = np.asarray(library.transform(states)), library.get_feature_names()
    tried = []
    for threshold in THRESHOLDS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # alpha of the default is a ridge that also shrinks; whoever tunes the threshold turns it off.
            found = pysindy.STLSQ(threshold=threshold, alpha=0.0).fit(columns, moments).coef_[0]
        tried.append({name for name, c in zip(names, found, strict=True) if c})
    return next((terms for terms in tried if terms == set(TERMS)), tried[0])


def plugged(campaign: Any, labelled: bool) -> set[str]:
    """Return the terms that pysindy keeps with this package's library and optimizer."""
    import pysindy

    from sindyjoint import TermLibrary, UniqueShareSTLSQ
    from sindyjoint.states import campaign_states, regression_rows

    rows = regression_rows(campaign_states(campaign), campaign.joint.inertia)
    library, labels = TermLibrary("extended"), {}
    if labelled:
        replicate = np.asarray(library.fit(rows.X).transform(rows.X_replicate)), rows.y_replicate
        labels = dict(groups=rows.groups, runs=rows.runs, blocks=rows.blocks, replicate=replicate)
    model = pysindy.SINDy(feature_library=library, optimizer=UniqueShareSTLSQ(**labels))
    model.fit(rows.X, 1e-3, x_dot=rows.y[:, None])
    return {n for n, c in zip(model.get_feature_names(), model.coefficients()[0], strict=True) if c}


def campaign_of(joint: str, noise: float, seed: int) -> Any:
    """Return the virtual test of one of the paper's joints, or a short one of a random joint."""
    from sindyjoint.mechanics.virtual import virtual_campaign

    if joint != "random":
        return virtual_campaign(joint, noise=noise, random_state=seed)
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "recovery"))
    from random_joints import random_plan

    return random_plan(seed, duration=4.0, sample_rate=500.0).campaign(noise)


def one(joint: str, noise: float, seed: int) -> dict[str, set[str]]:
    """Return the terms that each way finds."""
    import pysindy

    from sindyjoint.workflows.discover import discover

    campaign = campaign_of(joint, noise, seed)
    states = moving(campaign)
    return {
        "plain": terms_of(plain(campaign, pysindy.FiniteDifference), None),
        "smooth": terms_of(plain(campaign, pysindy.SmoothedFiniteDifference), None),
        "states": terms_of(states, None),
        "scaled": terms_of(states, "rms"),
        "oracle": best_of_thresholds(states),
        "plugged": plugged(campaign, labelled=True),
        "bare": plugged(campaign, labelled=False),
        "sindyjoint": set(discover(campaign).model.ids),
    }


def main() -> None:
    """Run the campaigns; print how often each way finds the five terms and nothing else."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--joints", nargs="+", default=["inter-panel", "panel-root", "random"])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.001, 0.01, 0.05])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    given = with_rows(parser).parse_args()
    from joblib import Parallel, delayed

    sizes: dict[str, list[int]] = {}
    rows: dict[str, dict[str, Any]] = {}
    for noise in given.noise:
        for joint in given.joints:
            found = Parallel(n_jobs=given.jobs)(
                delayed(one)(joint, noise, seed) for seed in range(given.seeds)
            )
            for way in found[0]:
                exact = sum(each[way] == set(TERMS) for each in found)
                print(f"{joint:<12} {noise:>6.1%} {way:<12}{exact:>3} of {given.seeds}", flush=True)
                row = rows.setdefault(way, {"way": way, "campaigns": given.seeds * len(given.joints)})
                level = f"at {1000 * noise:g}"
                row[level] = row.get(level, 0) + exact
                sizes.setdefault(way, []).extend(len(each[way]) for each in found)
    for way, row in rows.items():
        row["terms"] = float(np.median(sizes[way]))
    write_rows(given.json, list(rows.values()))


if __name__ == "__main__":
    main()
