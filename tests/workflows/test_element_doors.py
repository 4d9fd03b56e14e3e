"""Doors that take a model take the whole of it: a table of elements and doors, by the command line."""

import json
from dataclasses import replace

import pytest

from sindyjoint import simulate as virtual_campaign
from sindyjoint.files import write_campaign
from sindyjoint.response import model_law
from tests.export.made import ELEMENTS, PAPER, model_of

RATE = 500.0


def saved(model, folder):
    folder.mkdir()
    (folder / "model.json").write_text(model.to_json())
    return folder


def asked(sindyjoint, tmp_path, model, command):
    """Return what a door says of a model, JSON and standard error, and of the same without its element."""
    said = []
    for name, one in (("whole", model), ("bare", model.without_elements())):
        answer = sindyjoint(
            *(saved(one, tmp_path / name) if part == "MODEL" else part for part in command), "--json"
        )
        assert answer.status in (0, 1), answer.stderr
        said.append((json.loads(answer.stdout), " ".join((answer.stdout + answer.stderr).split())))
    return said


def narrow(model):
    """Return a model that was tested to a tenth of what its tests here reach."""
    return replace(model, fitted=replace(model.fitted, angle=model.fitted.angle / 100))


@pytest.mark.parametrize(("drive", "level"), [("moment", "0.8"), ("displacement", "1.1")])
@pytest.mark.parametrize("effect", ELEMENTS)
def test_what_is_simulated_has_the_element(effect, drive, level, sindyjoint, tmp_path):
    model = model_of(PAPER, elements=[ELEMENTS[effect]])
    answer = sindyjoint(
        "simulate", "--model", saved(model, tmp_path / "m"), "--frequencies", "4", "--levels", level, "--duration", "2",
        "--noise", "0.001", "--drive", drive, "--out", tmp_path / "runs", "-q",
    )  # fmt: skip
    assert answer.status == 0
    assert ("beyond the tested range: angle up to" in answer.stderr) == (level == "1.1")
    command = ["verify", "MODEL", tmp_path / "runs", "--draws", "0"]
    (whole, _), (bare, _) = asked(sindyjoint, tmp_path, model, command)
    assert whole["response_nrmse"] < 0.01
    assert bare["response_nrmse"] is None or bare["response_nrmse"] > 0.05


DOORS = {
    "rig": ["rig", "pulse-rig", "--model", "MODEL"],
    "pulse": ["verify", "MODEL", "pulse-rig", "--draws", "0"],
    "curves": ["curves", "MODEL", "--frequency", "4 Hz"],
    "refine": ["discover", "RUNS", "--refine", "--model", "MODEL"],
    "compare": [
        "compare",
        "RUNS",
        "--model",
        "MODEL",
        "-l",
        "paper",
        "--method",
        "stlsq",
        "--replicates",
        "10",
    ],
}


@pytest.mark.parametrize("door", DOORS)
def test_no_door_drops_the_element_or_the_range(door, sindyjoint, tmp_path):
    model = narrow(model_of(PAPER, elements=[ELEMENTS["jenkins_element"]]))
    runs = tmp_path / "runs"
    virtual = virtual_campaign(
        model_law(model), drive="displacement", frequencies=[4.0], levels=[0.8], duration=2.0, sample_rate=RATE,
        noise=0.001, angle_limit=100 * model.fitted.angle,
    )  # fmt: skip
    write_campaign(replace(virtual, joint=model.joint), runs)
    command = [runs if part == "RUNS" else part for part in DOORS[door]]
    (whole, said), (bare, _) = asked(sindyjoint, tmp_path, model, command)
    assert whole != bare
    if door == "curves":
        assert whole["curves"][0]["tested"][0] and not whole["curves"][0]["tested"][-1]
    else:
        assert "beyond the tested range: angle up to" in said and "% of the time" in said


CANNOT = {
    "simulate": (
        ["simulate", "--model", "MODEL", "--levels", "2.5", "--frequencies", "4", "--duration", "1", "--out", "OUT"],
        "the joint left its range",
    ),
    "rig": (["diagnose", "pulse-rig", "--model", "MODEL", "--out", "OUT"], "cannot be simulated with the model"),
    "plot": (["plot", "MODEL", "loops", "--out", "OUT"], "holds no figures/data.json"),
}  # fmt: skip


@pytest.mark.parametrize("door", CANNOT)
def test_a_door_that_cannot_writes_nothing_and_says_why(door, sindyjoint, tmp_path):
    terms = PAPER | {"cubic_stiffness": 40 * PAPER["cubic_stiffness"]} if door == "rig" else PAPER
    model = model_of(terms, elements=[ELEMENTS["jenkins_element"]])
    places = {"MODEL": saved(model, tmp_path / "m"), "OUT": tmp_path / "out.svg"}
    command, why = CANNOT[door]
    answer = sindyjoint(*(places.get(part, part) for part in command))
    assert answer.status == 1 and why in answer.stderr.splitlines()[-1] and answer.stdout == ""
    assert not (tmp_path / "out.svg").exists()
