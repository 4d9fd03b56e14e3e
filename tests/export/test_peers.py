"""A law goes to another program, what that simulates comes back as a record, and ``verify`` has the same response."""

import numpy as np
import pytest
from resimulated import RATE, RUNNERS, drive, load, missing

from sindyjoint import Campaign, discover, simulate, verify
from sindyjoint.export import export_model, write_export
from tests.export.made import ELEMENTS, PAPER

#: Share of the response that may differ: steps of solvers are coarser than ours, and a functional mock-up unit holds
#: the moment from sample to sample, half of which is 0.6 % of a response at 4 Hz.
WITHIN = {"python": 1e-3, "c": 1e-3, "fmu": 1e-2, "mujoco": 1e-2, "opensees": 1e-2}


def response_of(model, moment, angle):
    """Return how ``verify`` holds a model against a record of its joint, without restart."""
    size = min(moment.size, angle.size)
    record = Campaign.from_arrays(
        moment=moment[:size], angle=angle[:size], rate=RATE, frequency=None, inertia=model.inertia
    )
    (run,) = verify(model, record, draws=0, free_run=20).runs
    assert run.drive == "free run"
    return run.response_nrmse


@pytest.mark.parametrize("target", WITHIN)
def test_a_peer_s_record_is_verified(make_model, tmp_path, target):
    if reason := missing(target):
        pytest.skip(reason)
    model = make_model(PAPER, elements=[ELEMENTS["jenkins_element"]])
    moment = drive(4.5, periods=8)
    angle = RUNNERS[target](model, moment, tmp_path)
    assert response_of(model, moment, angle) < WITHIN[target]
    # Negative control: without its element it is another joint.
    assert response_of(make_model(PAPER), moment, angle) > 0.05


def test_python_control_s_record_is_verified(make_model, tmp_path):
    control = pytest.importorskip("control", reason="python-control is not installed")
    model = make_model({"linear_stiffness": 6066.0, "cubic_stiffness": -1e9, "linear_damping": 48.13})
    (path,) = write_export(export_model(model, "python"), tmp_path / "joint.py")
    law = load(path)

    def slope(time, state, moment, parameters):
        return [state[1], (moment[0] - law.transfer_moment(*state)) / model.inertia]

    joint = control.NonlinearIOSystem(slope, lambda t, x, u, p: x[:1], inputs=1, states=2, outputs=1)
    moment = drive(4.0, periods=8)
    time = np.arange(moment.size) / RATE
    found = control.input_output_response(
        joint, time, moment, [0.0, 0.0], solve_ivp_kwargs={"rtol": 1e-8, "atol": 1e-12}
    )
    assert response_of(model, moment, found.outputs) < 1e-3


def test_pysindy_s_record_is_verified(make_model):
    made = simulate(
        "inter-panel", frequencies=[3, 4, 5], levels=[0.9, 0.5], duration=4.0, noise=0.0, random_state=0
    )
    found = discover(made)
    moment = drive(4.5, periods=8)
    states = found.sindy.simulate([0.0, 0.0], np.arange(moment.size) / RATE, moment)
    assert response_of(found.model, moment, states[:, 0]) < 1e-3
