"""Every effect of the catalogue, hidden in a joint whose law is known, is what ``diagnose`` says is missing."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tests.doors.hidden import HIDDEN, LACKS, A, runs_of
from tests.doors.inventory import GOLDEN
from tests.doors.truth import NOISE, Truth, write

EFFECTS = json.loads(GOLDEN.read_text(encoding="utf-8"))["effects"]
PAPER = Path(__file__).resolve().parents[2] / "libraries" / "paper.toml"
# With states of their own, or among many that are: 10 to 30 s each.
LONG = {
    "dahl_friction", "bouc_wen_hysteresis", "jenkins_element", "lugre_friction", "backlash_play", "maxwell_branch",
    "fractional_damping",
}  # fmt: skip
# Beside free terms to the third power a shift of the angle is a constant, to the last digit.
SAME = {"angle_offset": "constant_moment"}


def test_every_effect_of_the_catalogue_is_hidden_once():
    assert set(HIDDEN) == set(EFFECTS)


@pytest.fixture
def base(tmp_path):
    """Return the options for a model that lacks a term of the paper's."""

    def without(name):
        if name not in LACKS:
            return []
        head, *terms = re.split(r"(?m)^\[\[term\]\]", PAPER.read_text(encoding="utf-8"))
        kept = [term for term in terms if f'id = "{name}"' not in term]
        assert len(kept) == 4
        path = tmp_path / "base.toml"
        path.write_text(
            "[[term]]".join([re.sub(r"(?m)^name = .*", 'name = "base"', head), *kept]), encoding="utf-8"
        )
        return ["--base", path]

    return without


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in EFFECTS]
)
def test_an_effect_is_named(name, base, tmp_path, sindyjoint):
    folder = write(tmp_path / "campaign", runs_of(name))
    options = ["--no-advice", "--max-effects", 1, "--json", *base(name)]
    record = json.loads(sindyjoint("diagnose", folder, *options).stdout)
    # Laws of one kind may be told apart by no run of this campaign: then the true one is among those that are named.
    # The response of a moment that is recorded late is another matter: its gap may stay.
    assert record["verdict"] in ("named", "ambiguous", "partly_named"), record["reason"]
    named = {one for step in record["steps"] for one in (step["effect"], *step["class"])}
    named |= {
        rival["effect"]
        for step in record["steps"]
        for rival in step["rivals"]
        if record["verdict"] == "ambiguous"
    }
    assert named & {name, SAME.get(name, name)}, record["reason"]
    # The gap falls to the noise of the moment, to which that of the angle adds; before it was twice that and more.
    assert record["gap"]["initial"]["moment"] > 2 * NOISE
    assert record["gap"]["final"]["moment"] < 1.5 * max(record["gap"]["noise_floor"]["moment"], NOISE)


@pytest.mark.parametrize("side", [1, -1])
def test_a_stop_on_one_side_is_found_with_its_gap_and_stiffness(side, tmp_path, sindyjoint):
    stop = Truth(hidden=lambda a, v, t: side * 4000 * np.maximum(side * a - 0.4 * A, 0.0))
    folder = write(tmp_path / "campaign", stop.runs(seed=5))
    record = json.loads(sindyjoint("diagnose", folder, "--no-advice", "--json").stdout)
    assert record["verdict"] == "named", record["reason"]
    (step,) = record["steps"]
    assert step["effect"] == "dead_zone"
    # Three standard errors of either number are 2 %.
    assert step["parameters"]["g"] == pytest.approx(0.4 * A, rel=0.03)
    assert step["parameters"]["k_s"] == pytest.approx(4000, rel=0.03)
