"""A rig in motion: what the command prints is what the structure does, and the energy adds up."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.reporting import drawable, load_results, write_results
from sindyjoint.workflows import rig_motion
from tests.conftest import RIGS
from tests.made_models import paper_model

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "reporting"))
from test_reporting_page import read  # noqa: E402


@pytest.fixture(scope="module")
def wing():
    return rig_motion("four-panel-wing")


def test_every_joule_has_a_place(wing):
    # The load's work, by the trapezoid of force over deflection at the point where it acts.
    response = wing.response
    tip = response.displacement[wing.rig.at]
    brought = float(np.sum((response.force[1:] + response.force[:-1]) / 2 * np.diff(tip)))
    assert sum(wing.heat.values()) + response.energy[-1] == pytest.approx(brought, rel=2e-3)
    assert list(wing.heat) == [*response.joints, "beams"]


def test_locked_joints_make_the_wing_stiffer_and_stop_for_good(wing):
    assert np.all(wing.locked > wing.slipping)
    for last, stuck in zip(wing.last_slips, wing.response.stuck, strict=True):
        assert stuck[wing.response.time > last + 1e-9].all()


def test_a_model_takes_the_places_that_wait_for_it(tmp_path):
    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8").replace('"inter-panel"', '"model"')
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="joint whose law is 'model', and no model was given; give --model"):
        rig_motion(tmp_path / "rig.toml")
    soft = rig_motion(tmp_path / "rig.toml", paper_model(values=(5000.0, 0.0, 0.0, 48.0, 1.8)))
    same = rig_motion(tmp_path / "rig.toml", paper_model())
    shipped = rig_motion("pulse-rig")
    assert soft.slipping[0] < same.slipping[0] == pytest.approx(shipped.slipping[0], rel=1e-6)
    with pytest.raises(InputError, match="joint in translation; those of .pulse rig. are in rotation"):
        rig_motion("pulse-rig", paper_model(motion="translation"))


def test_the_folder_is_complete_and_drawn_again(wing, tmp_path):
    folder = write_results(wing, tmp_path / "out", "sindyjoint rig four-panel-wing")
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.*"))
    assert names == ["figures/angles.svg", "figures/data.json", "figures/deflection.svg", "figures/heat.svg",
                     "figures/locked.svg", "report.html", "response.csv", "rig.json"]  # fmt: skip
    assert drawable(load_results(folder))
    head, first = (folder / "response.csv").read_text().splitlines()[:2]
    assert head.startswith("time_s,force_N,") and len(first.split(",")) == len(head.split(","))
    lines = read((folder / "report.html").read_text(encoding="utf-8")).lines
    assert any(line.startswith("Most of the energy, ") and line.endswith("root.") for line in lines)


def test_command(sindyjoint):
    answer = sindyjoint("rig", "pulse-rig", "--verbose")
    assert (
        answer.status == 0
        and "joints locked" in answer.stdout
        and "largest deflection at tip" in answer.stdout
    )
    assert "simulating 20 s" in answer.stderr and "events of joints" in answer.stderr
    record = json.loads(sindyjoint("rig", "pulse-rig", "--json").stdout)
    assert record["schema"] == 1 and record["joints"][0]["locked_share"] > 0.9
    refused = sindyjoint("rig", "no-rig")
    assert refused.status == 2 and refused.stdout == "" and refused.stderr.count("\n") == 1
    assert "'no-rig' is no rig" in refused.stderr
