"""Beam chains with joints: modes, energy, events, and a second engine."""

import numpy as np
import pytest

from sindyjoint.errors import InputError, SimulationError, UnknownNameError
from sindyjoint.mechanics import (
    INTER_PANEL,
    Beam,
    FunctionLaw,
    Hinge,
    LumpedMass,
    PaperLaw,
    SumLaw,
    assemble,
    craig_bampton,
    pulse,
    rectangular_section,
    respond,
    sampled,
)

STIFFNESS, MASS = rectangular_section(70e9, 2700.0, 0.050, 0.020)
HAMMER = pulse(65.0, 0.005)
# OpenSees starts from zero acceleration, so its pulse must start from zero force: straight lines through these.
HAMMER_SAMPLES = [0.0] + [65.0] * 10 + [0.0] * 10


def chain(law, loss=0.0, tip=8.0):
    lower, upper = (Beam(name, 0.5, STIFFNESS, MASS, 8, loss) for name in ("lower", "upper"))
    return assemble([lower, Hinge("joint", law), upper, LumpedMass("tip mass", tip)])


def elastic_slider(theta, omega, direction, state, parameters, out):
    """Elastic–perfectly plastic moment parallel to a spring; parameters k, stick stiffness, slip moment."""
    slider = min(max(state[0], -parameters[2]), parameters[2])
    out[0] = parameters[0] * theta + slider
    sliding = abs(state[0]) >= parameters[2] and state[0] * omega > 0
    out[1] = 0.0 if sliding else parameters[1] * omega


def test_cantilever_frequencies():
    # Blevins 1979, table 8-1: (λL)² = 3.5160, 22.0345, 61.6972
    beam = Beam("beam", 1.0, STIFFNESS, MASS, 16)
    expected = np.array([3.51602, 22.0345, 61.6972]) / (2 * np.pi) * np.sqrt(STIFFNESS / MASS)
    np.testing.assert_allclose(assemble([beam]).frequencies(3), expected, rtol=5e-5)


def test_soft_clamp_and_stiff_joint_approach_the_clamped_beam():
    beam = Beam("beam", 1.0, STIFFNESS, MASS, 8)
    clamped = assemble([beam]).frequencies(2)
    np.testing.assert_allclose(assemble([beam], 1e10).frequencies(2), clamped, rtol=1e-5)
    hinged = assemble([Hinge("root", PaperLaw(k1=1e10)), beam])
    np.testing.assert_allclose(hinged.frequencies(2), clamped, rtol=1e-5)
    np.testing.assert_allclose(hinged.frequencies(2, locked=True), clamped, rtol=1e-9)


def test_static_deflection_of_a_cantilever_with_a_hinge():
    # F·L³/(3·E·I) + F·L_hinge²/k
    structure = chain(PaperLaw(k1=6066.0))
    stiffness = structure.stiffness.copy()
    stiffness[0, 0] += 6066.0
    tip = structure.point("tip")
    deflection = tip @ np.linalg.solve(stiffness, 10.0 * tip)
    assert deflection == pytest.approx(10.0 / (3 * STIFFNESS) + 10.0 * 0.25 / 6066.0, rel=1e-9)


def test_reduction_keeps_the_low_modes():
    full = chain(INTER_PANEL)
    reduced = craig_bampton(full, ["tip"], modes=8)
    assert len(reduced.mass) == 10
    np.testing.assert_allclose(reduced.frequencies(4), full.frequencies(4), rtol=1e-4)


def test_undamped_chain_keeps_its_energy():
    response = respond(chain(PaperLaw(k1=6066.0)), HAMMER)
    free = response.energy[response.time > 0.006]
    assert np.ptp(free) < 1e-9 * free[0]


def test_energy_is_spent_by_joint_and_beams_only():
    response = respond(chain(INTER_PANEL, loss=0.004), HAMMER)
    hammer = 65.0 * response.displacement["tip"][response.time.searchsorted(0.005 - 1e-9)]
    lost = response.joint_dissipation[0] + response.beam_dissipation
    assert hammer - response.energy[-1] == pytest.approx(lost, rel=1e-3)
    start = np.searchsorted(response.time, 0.006)
    after = response.energy[start:]
    assert np.all(np.diff(after) < 1e-9 * after[0])


def test_joint_slips_then_locks_and_rests_exactly():
    response = respond(chain(INTER_PANEL, loss=0.004), HAMMER)
    angle, stuck = response.angle[0], response.stuck[0]
    last = np.flatnonzero(~stuck)[-1]
    assert 0.5 < response.time[last] < 5.0
    assert np.ptp(angle[last + 1 :]) == 0.0
    assert np.all(response.rate[0][stuck] == 0.0)
    inside = response.moment[0][stuck] - INTER_PANEL.moment(angle[stuck], 0.0, 0.0)
    assert np.abs(inside).max() <= INTER_PANEL.M_F * (1 + 1e-9)
    # locked, the structure rings at the locked frequency
    tip = response.displacement["tip"][response.time > 10]
    spectrum = np.abs(np.fft.rfft(tip * np.hanning(tip.size), 2**18))
    found = np.argmax(spectrum) * 1000.0 / 2**18
    assert found == pytest.approx(chain(INTER_PANEL).frequencies(1, locked=True)[0], rel=2e-3)


def test_second_order_in_the_step():
    structure = chain(PaperLaw(k1=6066.0, k3=-2e9, c1=5.0), tip=8.0)
    options = {"duration": 0.5, "sample_rate": 200.0}
    runs = [
        respond(structure, pulse(3.0, 0.05, "half-sine"), step=h, **options).displacement["tip"]
        for h in (2.5e-3, 1.25e-3, 1.5625e-4)
    ]
    coarse, fine = (np.abs(run - runs[2]).max() for run in runs[:2])
    # 4 for an exact reference; the reference's error of 1/256 moves it little
    assert coarse / fine == pytest.approx(4.0, rel=0.15)


def test_friction_joint_converges_with_the_step():
    structure = chain(INTER_PANEL, loss=0.004)
    options = {"duration": 2.0, "sample_rate": 200.0}
    runs = [
        respond(structure, pulse(20.0, 0.02, "half-sine"), step=h, **options).displacement["tip"]
        for h in (1e-3, 5e-4, 6.25e-5)
    ]
    coarse, fine = (np.abs(run - runs[2]).max() for run in runs[:2])
    assert coarse / fine > 2.5
    assert fine < 2e-3 * np.abs(runs[2]).max()


def maxwell(theta, omega, direction, state, parameters, out):
    """Spring and dashpot in series; parameters stiffness, relaxation time."""
    out[0] = state[0]
    out[1] = parameters[0] * omega - state[0] / parameters[1]


@pytest.mark.parametrize(
    "branch", [None, FunctionLaw(maxwell, (600.0, 0.03), n_states=1)], ids=["paper", "maxwell"]
)
def test_one_joint_alone_agrees_with_the_single_joint_solver(branch):
    # A short stiff beam with a mass at its end is an inertia m·L² on the joint. The two solvers share no stepping.
    # The beam is damped: without, it rings while the joint sticks and shakes it loose for a sample here and there.
    from sindyjoint.mechanics import simulate

    law = INTER_PANEL if branch is None else SumLaw(INTER_PANEL, branch)
    arm = Beam("arm", 0.5, 1e8, 1e-4, 1, loss_factor=0.3)
    structure = assemble([Hinge("joint", law), arm, LumpedMass("mass", 20.0)])
    rate = 1000.0
    force = 6.0 * np.sin(2 * np.pi * 4.0 * np.arange(2001) / rate)
    response = respond(structure, sampled(force, rate), step=1e-4, duration=2.0, modes=2)
    beam_inertia = 20.0 * 0.25 - INTER_PANEL.inertia
    single = simulate(law, sampled(0.5 * force, rate), 2.0, rate, rtol=1e-9, beam_inertia=beam_inertia)
    n = single.angle.size
    assert 0.02 < single.stuck.mean() < 0.9
    # 1e-4: the step is of second order, and the arm bends by 1e-5 of the joint's angle
    assert np.abs(response.angle[0][:n] - single.angle).max() < 1e-4 * np.abs(single.angle).max()
    assert np.count_nonzero(response.stuck[0][:n] != single.stuck) <= 2


def opensees_pulse(slider):
    """Tip deflection of the rig in OpenSees, Newmark with average acceleration."""
    ops = pytest.importorskip(
        "openseespy.opensees", reason="openseespy, or Debian's libblas3 and liblapack3, is absent"
    )
    n, length = 8, 0.5 / 8
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    ops.geomTransf("Linear", 1)
    for i in range(n + 1):
        ops.node(1 + i, length * i, 0.0)
        ops.node(101 + i, 0.5 + length * i, 0.0)
    ops.fix(1, 1, 1, 1)
    ops.equalDOF(1 + n, 101, 1, 2)
    area, youngs = 0.05 * 0.02, 70e9
    for base in (1, 101):
        for i in range(n):
            ops.element("elasticBeamColumn", base + i, base + i, base + i + 1, area, youngs, STIFFNESS / youngs, 1,
                        "-mass", MASS, "-cMass")  # fmt: skip
    ops.uniaxialMaterial("Elastic", 1, 6066.0)
    if slider:
        ops.uniaxialMaterial("ElasticPP", 2, slider[0], slider[1] / slider[0])
        ops.uniaxialMaterial("Parallel", 3, 1, 2)
    ops.element("zeroLength", 999, 1 + n, 101, "-mat", 3 if slider else 1, "-dir", 6)
    ops.mass(101 + n, 8.0, 8.0, 0.0)
    frequencies = np.sqrt(ops.eigen("-fullGenLapack", 2)) / (2 * np.pi)
    step, count = 5e-4, 10_000
    ops.timeSeries("Path", 1, "-dt", step, "-values", *HAMMER_SAMPLES)
    ops.pattern("Plain", 1, 1)
    ops.load(101 + n, 0.0, 1.0, 0.0)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", 1e-13, 50)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    tip = np.zeros(count + 1)
    for i in range(count):
        assert ops.analyze(1, step) == 0
        tip[i + 1] = ops.nodeDisp(101 + n, 2)
    ops.wipe()
    return frequencies, tip[::2]


def frequency_of(motion, near):
    """Frequency of a motion, Hz: from its phase against a nearby tone in two spans 3 s apart."""
    time = np.arange(motion.size) / 1000
    phases = []
    for start in (500, 3500):
        seen = slice(start, start + 1500)
        tone = np.exp(-2j * np.pi * near * time[seen])
        phases.append(np.angle(np.sum(np.hanning(1500) ** 2 * motion[seen] * tone)))
    return near + (np.diff(phases)[0] + np.pi) % (2 * np.pi) / (6 * np.pi) - 1 / 6


@pytest.mark.parametrize("slider", [None, (2e5, 1.867)], ids=["linear", "elastic-plastic"])
def test_agrees_with_opensees(slider):
    frequencies, tip = opensees_pulse(slider)
    law = FunctionLaw(elastic_slider, (6066.0, *slider), n_states=1) if slider else PaperLaw(k1=6066.0)
    if slider is None:
        np.testing.assert_allclose(chain(law).frequencies(2), frequencies, rtol=1e-4)
    response = respond(chain(law), sampled(HAMMER_SAMPLES, 2000.0, "linear"), duration=5.0, modes=20)
    ours = response.displacement["tip"][: tip.size]
    assert np.abs(ours - tip[: ours.size]).max() < 0.01 * np.abs(tip).max()
    # Of the motion itself: once the joint has stopped yielding it rings with its stick stiffness.
    near = frequencies[0] - 0.1
    theirs = frequency_of(tip, near)
    assert theirs == pytest.approx(frequencies[0], rel=1e-3)
    assert frequency_of(ours, near) == pytest.approx(theirs, rel=1e-4)


def test_hidden_presliding_runs_in_a_structure():
    law = SumLaw(
        PaperLaw(6.066e3, -1.927e5, -2.684e9, 48.13, 0.0), FunctionLaw(elastic_slider, (0.0, 4e4, 1.867), 1)
    )
    response = respond(chain(law, loss=0.004), HAMMER, duration=3.0)
    assert not response.stuck[0][100:].any()
    hammer = 65.0 * response.displacement["tip"][response.time.searchsorted(0.005 - 1e-9)]
    lost = response.joint_dissipation[0] + response.beam_dissipation
    assert hammer - response.energy[-1] == pytest.approx(lost, rel=1e-3)
    assert response.joint_dissipation[0] > 0.3 * hammer


@pytest.mark.parametrize(
    ("items", "message"),
    [
        ([], "no beam"),
        ([Hinge("a", INTER_PANEL)], "no beam"),
        ([Beam("b", 1.0, 1.0, 1.0), Hinge("a", INTER_PANEL)], "joint 'a' is followed by nothing"),
        (
            [Hinge("a", INTER_PANEL), Hinge("c", INTER_PANEL), Beam("b", 1, 1, 1)],
            "joint 'a' is followed by 'c'",
        ),
        ([LumpedMass("m", 1.0), Beam("b", 1, 1, 1)], "begins with mass 'm'"),
        ([Beam("b", 1, 1, 1), Beam("b", 1, 1, 1)], "b used twice"),
        ([Beam("b", 1, 1, 1), LumpedMass("tip", 1.0)], "'tip', as the free end of every chain is"),
        ([Beam("b", 1, 1, 1), LumpedMass("m", -1.0)], "'m': mass is -1.0"),
    ],
)
def test_bad_chains_say_what_is_wrong(items, message):
    with pytest.raises(InputError, match=message):
        assemble(items)


@pytest.mark.parametrize("name", ["length", "bending_stiffness", "mass_per_length"])
def test_bad_beams_name_the_field(name):
    good = {"length": 1.0, "bending_stiffness": 1.0, "mass_per_length": 1.0}
    with pytest.raises(InputError, match=f"beam 'b': {name} is 0.0"):
        Beam("b", **(good | {name: 0.0}))


def test_bad_simulations_say_what_is_wrong():
    structure = chain(INTER_PANEL)
    with pytest.raises(InputError, match="too large for the first mode at 4 Hz; expected at most 0.0125 s"):
        respond(structure, HAMMER, step=0.02)
    with pytest.raises(
        UnknownNameError, match="point 'top' is not in the chain; expected one of lower, joint, upper"
    ):
        respond(structure, HAMMER, at="top")
    with pytest.raises(SimulationError, match="joint 'joint' left its angle range .* at t = 0.0") as caught:
        respond(structure, pulse(650.0, 0.005))
    assert caught.value.time < 0.1
