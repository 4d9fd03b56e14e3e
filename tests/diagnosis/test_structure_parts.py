"""The parts of the diagnosis of a structure: interpreted laws, effects as changes, noise of a record, ranking."""

from dataclasses import replace

import numpy as np
import pytest
import sympy

from sindyjoint.diagnosis import (
    JointLaws,
    Scales,
    Setup,
    joint_changes,
    load_effects,
    record_noise,
    regions_of,
    select_effects,
    steady_level,
    structure_changes,
)
from sindyjoint.equation import Reference
from sindyjoint.mechanics import INTER_PANEL, FormulaLaw, LumpedMass, load_rig, presliding_law, with_laws
from tests.made_models import paper_model

THETA, OMEGA, Z = sympy.symbols("theta omega z", real=True)
ANGLE, RATE = 4e-4, 0.02


def paper_expression():
    k1, k2, k3, c1, m_f = sympy.symbols("k1 k2 k3 c1 M_F", real=True)
    elastic = k1 * THETA + k2 * THETA**2 + k3 * THETA**3 + c1 * OMEGA
    numbers = dict(zip(("k1", "k2", "k3", "c1", "M_F"), INTER_PANEL.parameters.tolist(), strict=True))
    return elastic, m_f, numbers


def tip(rig, law, **options):
    return with_laws(rig, lambda hinge: law).respond(**options).displacement["tip"]


def test_an_interpreted_law_moves_a_structure_like_a_compiled_one():
    rig = load_rig("pulse-rig")
    elastic, m_f, numbers = paper_expression()
    law = FormulaLaw(elastic + m_f * sympy.sign(OMEGA), numbers, softening_limit=INTER_PANEL.softening_limit)
    assert np.allclose(
        law.moment([1e-4, 0.0], [0.01, 0.0], [1, -1]), INTER_PANEL.moment([1e-4, 0.0], [0.01, 0.0], [1, -1])
    )
    # The same arithmetic in another order: rounding only.
    want = tip(rig, INTER_PANEL, duration=2.0)
    assert np.abs(tip(rig, law, duration=2.0) - want).max() < 1e-9 * np.abs(want).max()
    rate = (OMEGA - sympy.Abs(OMEGA) * Z) / sympy.Symbol("y", positive=True)
    memory = FormulaLaw(elastic + m_f * Z, {**numbers, "y": 2e-5}, {"z": rate})
    want = tip(rig, presliding_law(INTER_PANEL, 2e-5), duration=2.0)
    assert np.abs(tip(rig, memory, duration=2.0) - want).max() < 1e-7 * np.abs(want).max()
    other = law.with_parameters({"k1": 2 * INTER_PANEL.k1})
    assert other.moment([1e-4], [0.0], [0])[0] > 1.9 * law.moment([1e-4], [0.0], [0])[0]


def laws_and_changes(ids):
    laws = JointLaws(paper_model(), INTER_PANEL.softening_limit)
    changes = joint_changes(laws, select_effects(load_effects(), ids), Reference(ANGLE, RATE), 3.0)
    return laws, {f"{c.effect.id} {c.way}": c for c in changes}


def test_friction_that_gives_way_first_is_the_presliding_law():
    laws, changes = laws_and_changes(["dahl_friction", "maxwell_branch"])
    rig = load_rig("pulse-rig")
    setup = Setup(rig.items, 0.0, laws.numbers())
    change = changes["dahl_friction dahl_friction_0r"]
    law = laws.law(change.apply(setup, np.log([2e-5])))
    want = tip(rig, presliding_law(INTER_PANEL, 2e-5), duration=1.0)
    # The level under steady slip is found at a finite rate and angle.
    assert np.abs(tip(rig, law, duration=1.0) - want).max() < 1e-4 * np.abs(want).max()
    assert change.report(np.log([2e-5])) == pytest.approx({"theta_y": 2e-5})
    # A dashpot's moment grows with the rate: it is no friction.
    assert "maxwell_branch maxwell_branch_0r" not in changes
    assert "maxwell_branch maxwell_branch_0a" in changes


@pytest.mark.parametrize("name", ["dahl_friction", "jenkins_element"])
def test_the_moment_of_friction_under_steady_slip_is_its_level(name):
    variant = select_effects(load_effects(), [name])[0].variants[0]
    for fast in (100.0, 200.0):
        level = steady_level(variant, np.array([2e-5]), Reference(ANGLE, RATE), fast)
        assert level == pytest.approx(2e-5, rel=1e-3)


def test_the_moment_of_a_dashpot_under_steady_slip_grows_with_the_rate():
    variant = select_effects(load_effects(), ["maxwell_branch"])[0].variants[0]
    once, twice = (steady_level(variant, np.array([1e-3]), Reference(ANGLE, RATE), f) for f in (5.0, 10.0))
    assert once == pytest.approx(5 * RATE * 1e-3, rel=1e-3) and twice == pytest.approx(2 * once, rel=1e-3)


def test_every_change_does_nothing_where_it_is_zero_and_something_elsewhere():
    rig = replace(load_rig("pulse-rig"), duration=0.5)
    laws, inside = laws_and_changes(["quadratic_damping"])
    setup = Setup(rig.items, 0.0, laws.numbers())
    outside = structure_changes(load_effects(of="structure"), setup, Scales(0.25, 1e-3, 0.5))
    assert {c.effect.id for c in outside} == {e.id for e in load_effects(of="structure")}
    for change in (*outside, *inside.values()):
        same = change.apply(setup, change.start)
        assert same.items == setup.items and same.compliance == 0 and (same.pulse, same.gain) == (1, 1)
        assert laws.law(same).moment([2e-4], [0.01], [1.0]) == pytest.approx(
            INTER_PANEL.moment([2e-4], [0.01], [1.0])
        )
        moved = change.apply(setup, change.start + 0.5 * (change.high - change.start))
        assert moved.motion_key != same.motion_key or replace(moved, numbers={}, items=()) != replace(
            same, numbers={}, items=()
        )
    assert not any(
        isinstance(i, LumpedMass) and i.mass < 0 for c in outside for i in c.apply(setup, c.low).items
    )


@pytest.mark.parametrize("level", [1e-3, 1e-2, 5e-2])
def test_the_noise_of_a_decay_is_measured(level):
    generator = np.random.default_rng(4)
    t = np.arange(6000) / 1000
    decay = np.exp(-0.1 * t) * np.sin(2 * np.pi * 4.37 * t) + 0.05 * np.exp(-t) * np.sin(2 * np.pi * 61.3 * t)
    found = record_noise(decay + level * generator.standard_normal(t.size), 1000.0)
    # 2400 samples of noise: its RMS is known to 1.5 %, and three times that.
    assert found.sigma == pytest.approx(level, rel=0.05) and found.length < 1.3


def test_noise_whose_neighbours_go_together_counts_fewer_samples():
    generator = np.random.default_rng(5)
    t = np.arange(8000) / 1000
    noise = generator.standard_normal(t.size)
    for i in range(1, t.size):
        noise[i] += 0.8 * noise[i - 1]  # (1 + 0.8)/(1 − 0.8) = 9 samples count as one
    found = record_noise(
        np.exp(-0.1 * t) * np.sin(2 * np.pi * 4.37 * t) + 0.01 * noise / np.std(noise), 1000.0
    )
    # The windows' trend takes some of the slow part with it.
    assert found.sigma == pytest.approx(0.01, rel=0.1) and 5 < found.length < 11


def test_where_a_gap_lies_in_time_and_phase():
    t = np.arange(8000) / 1000
    decay = np.exp(-0.2 * t) * np.sin(2 * np.pi * 4 * t)
    slow = np.exp(-0.2 * t) * np.sin(2 * np.pi * 4 * 1.002 * t)
    weak = np.exp(-0.25 * t) * np.sin(2 * np.pi * 4 * t)
    kinds = {
        place.range: place.share
        for signal in (slow, weak)
        for _, place in regions_of(decay, signal, 1000.0, 1e-4)
        if place.axis == "phase"
    }
    assert kinds["period"] > 0.95 and kinds["amplitude"] > 0.95
    early = decay.copy()
    early[:400] *= 1.2
    times = [p for _, p in regions_of(decay, early, 1000.0, 1e-4) if p.axis == "time"]
    assert times[0].range[0] == 0 and times[0].share > 0.9
