"""Angles and moments of cut-open joints from the sensors of the structure."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.mechanics import (
    INTER_PANEL,
    Beam,
    Hinge,
    LumpedMass,
    RigRun,
    RigTest,
    Sensor,
    UncertainNumber,
    assemble,
    uncertain_numbers,
)
from sindyjoint.substructure import (
    expected_jumps,
    held_spectra,
    held_warnings,
    joint_states,
    joints_seen,
    open_joints,
    recover,
    static_moments,
    update_structure,
    with_numbers,
    worth_of_sensors,
)

from .two_masses import C0, K0, M1, M2, RATE, passing_run, prescribed_run, rig_test, series, structure


def relative(found, true):
    return np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2))


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
def test_motion_and_force_of_a_joint_are_recovered_to_rounding(quantity):
    run, elongation, force = prescribed_run()
    if quantity != "acceleration":
        # The same motion by other sensors, integrated harmonic by harmonic.
        spectrum = np.fft.rfft(run.responses)
        angular = 2j * np.pi * np.fft.rfftfreq(run.drive.size, 1 / RATE)
        angular[0] = 1.0
        spectrum[:, 0] = 0.0
        power = {"velocity": 1, "displacement": 2}[quantity]
        run = replace(run, responses=np.fft.irfft(spectrum / angular**power, run.drive.size))
    recovery = recover(rig_test([run], quantity=quantity), run)
    states = joint_states(recovery, 0, "run")
    first = recovery.spectra.first
    assert relative(states.angle, elongation[first:]) < 1e-9
    assert relative(states.moment, force[first:]) < 1e-9


def test_a_run_that_neither_repeats_nor_rests_is_recovered_over_its_whole_record():
    """The jumps at its ends are found with it; accelerometers leave mean, drift and bend of the elongation open."""
    run, elongation, force = passing_run()
    recovery = recover(rig_test([run]), run)
    states = joint_states(recovery, 0, "run")
    n, inner = states.n_samples, slice(60, -60)
    assert recovery.ends is not None and recovery.ends.unknowns > 0
    error = (states.angle - elongation[:n])[inner]
    error -= np.polyval(np.polyfit(states.time[inner], error, 2), states.time[inner])
    assert np.std(error) < 0.001 * np.std(elongation)
    # The mean force is that of equilibrium under the mean drive, which the moving ends change.
    assert np.std((states.moment - force[:n])[inner]) < 0.001 * np.std(force)
    without = joint_states(replace(recovery, ends=None), 0, "run")
    assert np.std((without.moment - force[:n])[inner]) > 0.005 * np.std(force)


def test_a_stiff_mode_may_jump_by_its_static_answer():
    """Inertia loads a mode of ω₀ as ω²: of a slower motion (ω/ω₀)² is its own, and below ω all of it may be."""
    sensors, angular, modes = (
        [Sensor("w", "tip", "displacement")],
        np.array([10.0]),
        np.array([0.0, 5.0, 100.0]),
    )
    jumps = expected_jumps(sensors, np.array([[2e-3j]]), angular, modes)
    assert jumps / jumps[0] == pytest.approx([1, 1, 0.01, 10, 10, 0.1])


def test_the_order_of_the_sensors_does_not_matter():
    run, _, _ = prescribed_run()
    noise = 0.01 * np.random.default_rng(0).normal(size=(3, run.drive.size))
    noisy = replace(run, drive=run.drive + noise[0], responses=run.responses + noise[1:])
    one = recover(rig_test([noisy]), noisy)
    turned = replace(noisy, responses=noisy.responses[::-1])
    other = recover(rig_test([turned], sensors=("x2", "x1")), turned)
    assert one.values == pytest.approx(other.values, rel=1e-9)
    assert one.misfit == pytest.approx(other.misfit, rel=1e-9)


def test_errors_are_as_large_as_said():
    # Of whole samples, so that the periods that are left out move no phase.
    run, _, _ = prescribed_run(frequency=2.5, periods=30)
    exact, generator = recover(rig_test([run]), run).values, np.random.default_rng(1)
    scores = []
    for _ in range(20):
        noise = 0.02 * generator.normal(size=(3, run.drive.size))
        noisy = replace(run, drive=run.drive + noise[0], responses=run.responses + noise[1:])
        found = recover(rig_test([noisy]), noisy)
        same = min(found.values.shape[1], exact.shape[1])
        scores.append(((found.values - exact).real / found.standard_error)[:, :same])
    assert 0.8 < np.std(scores) < 1.25
    assert found.misfit / found.degrees == pytest.approx(1.0, abs=0.4)


def test_a_shaken_base_is_seen_by_the_sensors_too():
    # Stiffly coupled, far below resonance: the masses follow the base, sensors show its acceleration.
    stiff = structure(stiffness=1e9)
    sensors = (Sensor("x1", "x1"), Sensor("x2", "x2"))
    transfer = open_joints(stiff, "base", sensors, np.array([6.0]))
    assert abs(transfer.sensors[0, 0, 0]) == pytest.approx(1.0, rel=1e-4)
    # The second mass hangs on the open joint alone: in space it stands still.
    assert abs(transfer.sensors[0, 1, 0]) < 1e-4


def test_mean_moments_of_a_chain_are_those_of_the_lever():
    items = (Hinge("root", INTER_PANEL), Beam("one", 0.5, 2000.0, 2.0, 4), Hinge("middle", INTER_PANEL),
             Beam("two", 0.7, 2000.0, 2.0, 4), LumpedMass("tip mass", 3.0))  # fmt: skip
    chain = assemble(items)
    assert static_moments(chain, "tip", 2.0) == pytest.approx([2 * 1.2, 2 * 0.7], rel=1e-6)
    assert static_moments(structure(), "x2", 3.0) == pytest.approx([3.0])
    held = replace(structure(), stiffness=structure().stiffness + np.diag([5.0, 0.0]))
    assert static_moments(held, "x2", 3.0) is None


def test_a_place_along_a_beam_deflects_as_the_beam_does():
    chain = assemble(
        [Beam("beam", 2.0, 500.0, 1.0, 3)], stations={"there": ("beam", 0.9), "end": ("beam", 2.0)}
    )
    deflection = np.linalg.solve(chain.stiffness, chain.point("tip"))
    assert chain.point("there") @ deflection == pytest.approx(0.9**2 * (3 * 2.0 - 0.9) / (6 * 500.0))
    assert chain.point("end") @ deflection == pytest.approx(2.0**3 / (3 * 500.0))
    with pytest.raises(InputError, match="above 0 up to the 2 m"):
        assemble([Beam("beam", 2.0, 500.0, 1.0, 3)], stations={"off": ("beam", 2.1)})
    with pytest.raises(KeyError, match="beam 'rod' is not in the chain"):
        assemble([Beam("beam", 2.0, 500.0, 1.0, 3)], stations={"off": ("rod", 0.1)})


def test_the_structures_own_numbers_are_updated_by_what_sensors_show():
    run, _, _ = prescribed_run()
    part = structure().stiffness
    zero = np.zeros((2, 2))
    number = UncertainNumber("spring", 0.03, zero, part / 0.98, zero)
    generator = np.random.default_rng(2)
    noisy = replace(
        run, drive=run.drive + 0.02 * generator.normal(size=run.drive.size),
        responses=run.responses + 0.002 * generator.normal(size=run.responses.shape),
    )  # fmt: skip
    # Two sensors and one joint overdetermine the drive, not the spring: it stays what it was said to be.
    described = structure(stiffness=0.98 * K0)
    test = rig_test([noisy], structure=described, uncertain=(number,))
    update = update_structure(test, [recover(test, noisy)])
    assert update is not None and update.standard_error[0] <= 0.03 * 1.001
    assert abs(update.change[0] - 0.02) < 3 * update.standard_error[0]
    assert update_structure(rig_test([run]), []) is None


def test_a_clamp_that_is_stiffer_than_described_is_found():
    """Under any drive and joint moment the sensors disagree with the described clamp, and agree with the true one."""
    items = [Beam("one", 0.5, 2e3, 2.0, 4), Hinge("joint", INTER_PANEL), Beam("two", 0.5, 2e3, 2.0, 4)]
    sensors = tuple(Sensor(name, name) for name in ("low", "joint", "middle", "tip"))
    stations = {"low": ("one", 0.3), "middle": ("two", 0.25)}
    described, true = (assemble(items, clamp, stations, 5.0) for clamp in (2e4, 2.1e4))
    generator, time = np.random.default_rng(7), np.arange(4000) / 500
    angular = 2 * np.pi * 4 * np.arange(1, 6)
    loads = generator.normal(size=(5, 2)) + 1j * generator.normal(size=(5, 2))
    shown = np.einsum("hsk,hk->sh", open_joints(true, "tip", sensors, angular).sensors, loads)
    wave = np.exp(1j * np.outer(angular, time))
    drive, responses = (loads[:, 0] @ wave).real, (shown @ wave).real
    noise = 0.003 * responses.std(axis=1, keepdims=True) * generator.normal(size=responses.shape)
    run = RigRun("run", drive + 0.003 * generator.normal(size=time.size), responses + noise, 500.0, 4.0)
    (number,) = uncertain_numbers(items, 2e4, {}, 0.1)
    test = RigTest("clamped", described, ("joint",), "tip", sensors, (run,), uncertain=(number,))
    update = update_structure(test, [recover(test, run)])
    assert update.names == ("stiffness of the clamp",) and update.standard_error[0] < 0.02
    assert abs(update.change[0] - 0.05) < 3 * update.standard_error[0] + 0.1 * 0.05**2


def test_fewer_sensors_than_joints_are_refused():
    items = [
        Hinge("a", INTER_PANEL),
        Beam("one", 0.5, 2e3, 2.0, 2),
        Hinge("b", INTER_PANEL),
        Beam("two", 0.5, 2e3, 2.0, 2),
    ]
    run = RigRun("run", np.ones(100), np.ones((1, 100)), 100.0, 5.0)
    test = RigTest(
        "two joints", assemble(items, loss_frequency=1.0), ("a", "b"), "tip", (Sensor("t", "tip"),), (run,)
    )
    with pytest.raises(InputError, match="1 sensor.* for 2 joints"):
        recover(test, run)


def test_what_each_sensor_is_worth():
    run, _, _ = prescribed_run()
    noise = np.random.default_rng(3).normal(size=(3, run.drive.size))
    noisy = replace(run, drive=run.drive + 0.02 * noise[0], responses=run.responses + 0.02 * noise[1:])
    test = rig_test([noisy])
    recovery = recover(test, noisy)
    worth = worth_of_sensors(test, [recovery])
    assert worth.shape == (1, 2) and np.all(worth >= 0.999) and worth.max() > 1.01
    (seen,) = joints_seen(test, [recovery])
    assert seen.joint == "joint" and not seen.words
    assert "only: add a sensor" in replace(seen, moment_error=0.5).words
    assert "together with 'b'" in replace(seen, together=("b",)).words


def stuck_run(amplitude, stiffness=K0):
    """Both masses move as one on the spring, and the force on them is a multisine."""
    frequency, orders = 0.5, np.arange(4, 13)
    time = np.arange(int(20 * RATE)) / RATE
    drive = np.zeros(12, dtype=complex)
    drive[orders - 1] = amplitude * np.exp(2j * np.pi * np.random.default_rng(0).uniform(size=orders.size))
    omega = 2 * np.pi * frequency * np.arange(1, 13)
    moved = drive / (stiffness + 1j * omega * C0 - omega**2 * (M1 + M2))
    shown = series(frequency, moved, time, 2)
    noise = 0.01 * np.random.default_rng(1).normal(size=(3, time.size))
    force = series(frequency, drive, time)
    responses = np.array([shown, shown]) + noise[1:] * shown.std()
    return RigRun("stuck", force + noise[0] * force.std(), responses, RATE, frequency, use="update")


def test_runs_whose_joints_stick_tell_the_structures_numbers():
    """Where no joint moves the structure is a linear one: its stiffness follows to the noise, 3 % off as described."""
    back = np.array([0.0, 1.0])
    spring = UncertainNumber("spring", 0.05, *(np.zeros((2, 2)), K0 * np.outer(back, back), np.zeros((2, 2))))
    run, _, _ = prescribed_run()
    test = rig_test([run, stuck_run(1.0, 1.03 * K0)], uncertain=(spring,))
    assert [each.name for each in test.identification_runs] == ["prescribed"]
    held = held_spectra(test)
    update = update_structure(replace(test, runs=test.runs[1:]), [], held)
    assert update.change[0] == pytest.approx(0.03, abs=3 * update.standard_error[0])
    assert update.standard_error[0] < 0.001
    assert held_warnings(with_numbers(test, update.change), held) == ()
    assert "the joints slip in it" in held_warnings(test, held)[0]


def test_a_run_that_updates_the_structure_repeats():
    with pytest.raises(InputError, match="a run that updates the structure repeats"):
        replace(stuck_run(1.0), frequency=None)
