"""Curves of a structure that was tested by runs: where its laws come from, and closed forms of a linear one."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

import sindyjoint
from sindyjoint.equation import read_model, read_models
from sindyjoint.errors import InputError, MissingInputError
from sindyjoint.mechanics import Sensor, load_rig_structure
from sindyjoint.reporting import record_schema
from tests.made_models import model_of, paper_model, term

M1, M2, K0, C0, K, C = 2.0, 1.0, 400.0, 3.0, 900.0, 1.5
TWO_MASSES = """
name = "two masses"
[matrices]
file = "matrices.npz"
freedoms = ["x1", "x2"]
motion = "translation"
[[matrices.joint]]
name = "joint"
kind = "clamp"
between = ["x1", "x2"]
[drive]
point = "x2"
column = "f"
unit = "N"
[[sensor]]
column = "a1"
unit = "m/s^2"
point = "x1"
[[run]]
file = "never-read.npz"
frequency = "2 Hz"
"""


@pytest.fixture
def folder(tmp_path):
    np.savez(
        tmp_path / "matrices.npz",
        mass=np.diag([M1, M2]),
        stiffness=np.diag([K0, 0.0]),
        damping=np.diag([C0, 0.0]),
        base=np.ones(2),
    )
    (tmp_path / "rig.toml").write_text(TWO_MASSES)
    return tmp_path


def linear_model(**options):
    terms = [term("linear_stiffness", "theta", K), term("linear_damping", "omega", C)]
    return model_of(terms, inertia=0.0, angle=0.05, **({"name": "clamp", "motion": "translation"} | options))


def receptance(frequency):
    """Deflection of the second mass per force on it: the inverse of its dynamic stiffness, m/N."""
    w = 2 * np.pi * frequency
    joint = K + 1j * w * C
    first = K0 + joint - M1 * w**2 + 1j * w * C0
    return 1 / (joint - M2 * w**2 - joint**2 / first)


def test_a_linear_joint_in_matrices_has_the_receptance_of_its_closed_form(folder):
    found = sindyjoint.curves(
        folder, model=linear_model(), levels=[2.0], band=(1.5, 3.0), modes=1, harmonics=1
    )
    level = found.levels[0]
    # One harmonic balances a linear structure exactly; the steps along the curve leave 1e-6.
    assert level.amplitude / 2 == pytest.approx(np.abs(receptance(level.frequency)), rel=1e-5)
    assert found.point == found.at == "x2" and found.joints == ("joint",)
    record = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    jsonschema.validate(record, record_schema("structure-curves"))
    assert record["motion"] == "translation"
    header = (found.report(folder / "out") / "response.csv").read_text().splitlines()[0]
    assert "joint_elongation_m" in header and "rad" not in header


def test_a_mass_that_hangs_on_its_joint_alone_has_the_curves_of_the_joint(folder):
    np.savez(folder / "matrices.npz", mass=np.array([[M2]]), stiffness=np.zeros((1, 1)))
    one = TWO_MASSES.replace('freedoms = ["x1", "x2"]', 'freedoms = ["x2"]').replace('["x1", "x2"]', '["x2"]')
    (folder / "rig.toml").write_text(one.replace('point = "x1"', 'point = "x2"'))
    with pytest.raises(InputError, match="nothing beside its joints"):
        sindyjoint.curves(folder, model=linear_model())


def test_a_point_between_the_nodes_of_a_beam_is_driven_as_one_at_a_node():
    """Deflections by cubic shapes: a force a ten-millionth of the beam beside a node does what it does at the node."""
    test = load_rig_structure("pulse-rig")
    chain = replace(
        test.chain, stations={"beside": ("upper beam", 0.25 * (1 - 1e-7)), "node": ("upper beam", 0.25)}
    )
    test = replace(test, structure=chain.assembled(), sensors=(Sensor("a", "node"),), chain=chain)
    models = {"model": paper_model(0.0, name=test.kinds[0]), "levels": [0.4], "modes": 1, "harmonics": 1}
    beside, at = (sindyjoint.curves(test, at=point, **models).levels[0].peak for point in ("beside", "node"))
    assert beside == pytest.approx(at, rel=1e-5)


def test_a_rig_with_sensors_has_the_curves_of_the_same_rig_with_a_pulse():
    model = paper_model(0.02)
    chosen = {"levels": [0.8], "modes": 1, "harmonics": 5, "point": "tip"}
    test = load_rig_structure("pulse-rig")
    found = sindyjoint.curves(test, model=paper_model(0.02, name=test.kinds[0]), **chosen)
    other = sindyjoint.curves("pulse-rig", model=model, **chosen)
    # Two curves are stepped along differently where a sensor's point is a node of the mesh, too.
    assert found.levels[0].peak == pytest.approx(other.levels[0].peak, rel=1e-3)
    assert found.levels[0].peak_error == pytest.approx(other.levels[0].peak_error, rel=0.02)


def test_models_of_all_kinds_are_read_from_what_a_discovery_wrote(folder):
    for kind in ("clamp", "other"):
        (folder / "results" / kind).mkdir(parents=True)
        (folder / "results" / kind / "model.json").write_text(linear_model(name=kind).to_json())
    assert [model.joint.name for model in read_models(folder / "results")] == ["clamp", "other"]
    assert [model.joint.name for model in read_models(folder / "results" / "other")] == ["other"]
    with pytest.raises(MissingInputError, match=r"such as .*clamp or .*other"):
        read_model(folder / "results")


@pytest.mark.parametrize(
    ("models", "said"),
    [
        ([], r"joints without a law \(clamp\); give --model"),
        ([linear_model(), linear_model()], "two models stand for 'clamp'"),
        ([linear_model(), linear_model(name="hinge")], "no joint of kind 'hinge'.*it has clamp"),
        ([paper_model()], "of a joint in rotation; those of 'two masses' are in translation"),
    ],
)
def test_models_that_cannot_stand_for_a_joint_are_refused(folder, models, said):
    with pytest.raises(InputError, match=said):
        sindyjoint.curves(folder / "rig.toml", model=models)


def test_a_shaken_base_wants_a_point_for_the_force(folder):
    drive = '[drive]\npoint = "x2"\ncolumn = "f"\nunit = "N"'
    shaken = '[drive]\nquantity = "base acceleration"\ncolumn = "f"\nunit = "m/s^2"'
    assert drive in TWO_MASSES
    (folder / "rig.toml").write_text(TWO_MASSES.replace(drive, shaken))
    with pytest.raises(InputError, match="is shaken; give at"):
        sindyjoint.curves(folder, model=linear_model())
