"""Models with elements, re-simulated from what was exported: the same motion as in the simulation of the package."""

import numpy as np
import pytest
from resimulated import RATE, difference, drive, load, missing, mujoco_model, ours, run_c, run_fmu, run_python

from sindyjoint.export import export_model, write_export
from tests.export.made import ELEMENTS, PAPER

#: The largest difference of the angle while it slips. Code has our formulas; the solvers' own steps are coarser.
WITHIN = {"python": 1e-3, "c": 1e-3, "fmu": 1e-3, "mujoco": 1e-2, "opensees": 1e-2}
#: Elements that a target fits only nearly; the loss is stated.
FITTED = {("mujoco", "bouc_wen_hysteresis"), ("opensees", "lugre_friction")}


def terms(friction):
    """The paper's terms with another friction; a softening joint would snap through where friction is missing."""
    found = {"linear_stiffness": 6066.0, "cubic_stiffness": -1e9, "linear_damping": 48.13}
    return found | ({"coulomb_friction": friction} if friction else {})


def needed(target):
    """Skip where a target cannot run."""
    if reason := missing(target):
        pytest.skip(reason)


@pytest.mark.parametrize("target", WITHIN)
def test_the_five_terms_move_as_ours(make_model, tmp_path, target):
    needed(target)
    slipping, always = difference(target, make_model(PAPER), drive(), tmp_path)
    assert slipping < WITHIN[target] and always < WITHIN[target]


@pytest.mark.parametrize("friction", [1.867, 0.0])
@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("target", ["python", "mujoco", "opensees"])
def test_an_element_moves_as_ours(make_model, tmp_path, target, name, friction):
    needed(target)
    model = make_model(terms(friction), elements=[ELEMENTS[name]])
    moment = drive(5.0 if friction else 4.0)
    slipping, always = difference(target, model, moment, tmp_path)
    (row,) = (r for r in export_model(model, target).fidelity if r.term == name)
    assert row.carried and ("fitted" in row.representation) == ((target, name) in FITTED)
    # What is fitted misses some of the moment, as its table says; near friction's limit the motion feels it most.
    allowed = WITHIN[target] + (5 * row.error if (target, name) in FITTED else 0.0)
    assert slipping < allowed and always < allowed
    assert row.error < (0.06 if (target, name) in FITTED else 1e-4)


def test_an_element_that_is_left_out_shows(make_model, tmp_path):
    # Negative control: without its element the module moves by more than ten times what the comparison allows.
    whole, part = (make_model(terms(1.867), elements=e) for e in ([ELEMENTS["jenkins_element"]], ()))
    expected, _ = ours(whole, drive())
    angle = run_python(part, drive(), tmp_path)
    assert np.abs(angle[: expected.size] - expected).max() > 0.1 * np.abs(expected).max()


def test_all_elements_together_in_python_c_and_fmu(make_model, tmp_path):
    model, moment = make_model(terms(1.0), elements=ELEMENTS.values()), drive(12.0)
    (path,) = write_export(export_model(model, "python"), tmp_path)
    module = load(path)
    state = [0.0] * len(module.STATES)
    angle, rate = module.simulate(moment.tolist(), 1 / RATE, limits=None, state=state)
    assert module.STATES[:2] == ["jenkins_element.z", "backlash_play.z"] and all(state)
    assert abs(state[0]) <= 2e-4
    expected, stuck = ours(model, moment)
    assert np.abs(np.array(angle[:-1]) - expected).max() < 1e-3 * np.abs(expected).max()
    assert stuck.any() and np.mean((np.array(rate[:-1]) == 0.0) != stuck) < 0.01
    if not missing("c"):
        # The same algorithm in another language.
        np.testing.assert_allclose(run_c(model, moment, tmp_path), angle, atol=1e-9 * np.abs(angle).max())
    needed("fmu")
    from fmpy.validation import validate_fmu

    held, slider = run_fmu(model, moment, tmp_path, ("angle", "state_jenkins_element_z"))
    assert validate_fmu(str(tmp_path / "joint.fmu")) == []
    expected, _ = ours(model, moment, hold=True)
    assert np.abs(held[: expected.size] - expected).max() < 1e-3 * np.abs(expected).max()
    assert np.abs(slider).max() == pytest.approx(2e-4)


def test_mujoco_friction_creeps_as_the_file_says(make_model):
    # Nine tenths of friction on a joint without stiffness: a sticking joint would stand still.
    needed("mujoco")
    import mujoco

    model = make_model({"coulomb_friction": 1.867, "linear_damping": 1e-3})
    compiled = mujoco_model(model)
    data = mujoco.MjData(compiled)
    data.qfrc_applied[0] = 0.9 * 1.867
    for _ in range(2000):
        mujoco.mj_step(compiled, data)
    (note,) = (n for n in export_model(model, "mujoco").notes if "creeps" in n)
    said = float(note.split("sticking: ")[1].split(" ")[0])
    assert data.qvel[0] == pytest.approx(0.9 * said, rel=0.02)


def test_mujoco_knows_even_powers(make_model):
    # θ² and θ̇|θ̇| are coefficients of the joint; the passive force is minus the law at any state.
    needed("mujoco")
    import mujoco

    law = {"linear_stiffness": 6066.0, "quadratic_stiffness": -4e5, "cubic_stiffness": -1e9, "linear_damping": 40.0,
           "quadratic_damping": 300.0, "constant_moment": 0.2}  # fmt: skip
    model = make_model(law)
    export = export_model(model, "mujoco")
    assert export.not_carried == () and max(row.largest_error for row in export.fidelity) < 1e-12
    compiled = mujoco_model(model)
    data = mujoco.MjData(compiled)
    for angle, rate in ((5e-4, 0.03), (-6e-4, 0.02), (3e-4, -0.04)):
        data.qpos[0], data.qvel[0] = angle, rate
        mujoco.mj_forward(compiled, data)
        force = data.qfrc_passive[0] + data.qfrc_actuator[0]
        assert force == pytest.approx(-float(model.moment(angle, rate)), rel=1e-9)


@pytest.mark.parametrize("target", ["mujoco", "opensees"])
def test_other_terms_move_as_ours(make_model, tmp_path, target):
    needed(target)
    more = {
        "quadratic_stiffness": -4e5,
        "quadratic_damping": 300.0,
        "cubic_damping": 2e3,
        "constant_moment": 0.2,
    }
    model = make_model(terms(1.2) | more)
    assert export_model(model, target).not_carried == ()
    assert max(difference(target, model, drive(), tmp_path)) < WITHIN[target]


@pytest.mark.parametrize("target", ["mujoco", "opensees"])
def test_a_joint_that_slides(make_model, tmp_path, target):
    needed(target)
    elements = [ELEMENTS["jenkins_element"], ELEMENTS["maxwell_branch"]]
    model = make_model(terms(1.867), motion="translation", elements=elements)
    assert max(difference(target, model, drive(), tmp_path)) < WITHIN[target]
