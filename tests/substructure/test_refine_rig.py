"""Laws of joints inside a structure fitted to the simulated response; data by SciPy's integrator."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sindyjoint import discover_rig
from sindyjoint.diagnosis import runs_problem
from sindyjoint.equation import Fitted, JointModel, ModelTerm
from sindyjoint.judgement.joint_laws import with_terms
from sindyjoint.judgement.rig_discovery import RigRefinement, refine_rig, with_terms_of_the_response
from sindyjoint.mechanics import PaperLaw, RigRun, UncertainNumber
from sindyjoint.record import Joint
from sindyjoint.substructure import (
    SegmentedRun,
    coefficients,
    complex_amplitudes,
    recover,
    slow_lines,
    steady,
)

from .two_masses import C0, K0, M1, M2, RATE, integrated_run, rig_test, structure, swept_run

K, K3, C = 900.0, 4e6, 12.0
FORMULAS = {
    "linear_stiffness": "theta",
    "cubic_stiffness": "theta**3",
    "linear_damping": "omega",
    "coulomb_friction": "sign(omega)",
}


def model(*values):
    """A model whose numbers are known to 2 %."""
    terms = tuple(
        ModelTerm(id, id, id, "", formula, (), "", v, 0.02 * abs(v), (v, v), 1.0)
        for (id, formula), v in zip(FORMULAS.items(), values, strict=False)
    )
    covariance = np.diag([(0.02 * v) ** 2 for v in values])
    fitted = Fitted(1, 0, 0, 1, 100, 1, 6e-3, 0.1)
    return JointModel(Joint(motion="translation"), terms, tuple(map(tuple, covariance.tolist())), fitted)


@pytest.fixture(scope="module")
def runs():
    drives = [(1.5, 5.0), (2.5, 6.0), (4.0, 12.0)]
    return [
        integrated_run(f"{f:g} Hz", f, a, lambda d, v: K * d + K3 * d**3 + C * v, noise=0.005, seed=i)
        for i, (f, a) in enumerate(drives)
    ]


@pytest.fixture(autouse=True)
def few_harmonics(monkeypatch):
    """An elastic joint needs few: friction is what needs the others."""
    monkeypatch.setattr("sindyjoint.substructure.simulated.BALANCED", 23)
    monkeypatch.setattr("sindyjoint.substructure.simulated.BALANCED_ABOVE", 3)


def refined(test, given, **options):
    return refine_rig(test, [recover(test, run) for run in test.runs], {"joint": given}, **options)


def test_numbers_two_per_cent_off_come_back(runs):
    result = refined(rig_test(runs), model(1.03 * K, 0.97 * K3, 1.05 * C))
    assert result.refined and result.before > 5
    assert result.after == pytest.approx(1.0, abs=0.2)
    for term, true in zip(result.models["joint"].terms, (K, K3, C), strict=True):
        assert abs(term.coefficient - true) < 4 * term.standard_error
        assert term.standard_error < 0.01 * true
    assert len(result.ends) == 3 and max(result.ends) - min(result.ends) < 1


def test_numbers_of_the_structure_are_fitted_under_their_prior(runs):
    """The ground spring is 2 % softer in the file: with a prior of 2 % it comes back, and without one the law pays."""
    soft = structure(0.98 * 4000.0)
    zero = np.zeros((2, 2))
    stated = (UncertainNumber("stiffness", 0.02, zero, soft.stiffness, zero),)
    known = refined(rig_test(runs, structure=soft, uncertain=stated), model(K, K3, C), starts=1)
    assert known.update.change[0] == pytest.approx(1 / 0.98 - 1, abs=4 * known.update.standard_error[0])
    assert known.update.standard_error[0] < 0.005
    taken = refined(rig_test(runs, structure=soft), model(K, K3, C), starts=1)
    assert known.after < 1.2 and taken.after > 2


def softer(share):
    """A ground spring that is softer in the file than in truth, and the statement that it may be by 2 %."""
    soft = structure((1 - share) * K0)
    zero = np.zeros((2, 2))
    return {"structure": soft, "uncertain": (UncertainNumber("stiffness", 0.02, zero, soft.stiffness, zero),)}


def test_a_run_whose_joint_sticks_narrows_the_prior_of_the_structure(runs):
    """At 2.5 Hz both masses move as one: ``x″ = −ω²·F / (K0 − (M1 + M2)·ω² + i·ω·C0)``."""
    frequency, time = 2.5, np.arange(2400) / RATE
    wave, omega = np.exp(2j * np.pi * frequency * time), 2 * np.pi * frequency
    moved = -(omega**2) / (K0 - (M1 + M2) * omega**2 + 1j * omega * C0)
    noise = np.random.default_rng(7)
    signals = [(each * wave).real for each in (1.0, moved, moved)]
    drive, *shown = (each + 0.002 * each.std() * noise.normal(size=each.size) for each in signals)
    low = RigRun("low", drive, np.array(shown), RATE, frequency, use="update")
    options = softer(0.02)
    recoveries = [recover(rig_test([], **options), run) for run in runs[:1]]
    given = {"joint": model(K, K3, C)}
    alone, both = (
        refine_rig(rig_test(those, **options), recoveries, given, starts=1) for those in ([], [low])
    )
    assert both.update.prior[0] == 0.02
    assert both.update.change[0] == pytest.approx(1 / 0.98 - 1, abs=4 * both.update.standard_error[0])
    assert both.update.standard_error[0] < 0.7 * alone.update.standard_error[0]


@pytest.fixture(scope="module")
def sweeps():
    return [
        swept_run(
            f"{a:g} N", a, lambda d, v: K * d + K3 * d**3 + C * v, seconds=5.0, noise=0.005, seed=int(a)
        )
        for a in (3.0, 5.0)
    ]


def test_runs_that_do_not_repeat_are_refined_in_segments(sweeps):
    result = refined(rig_test(sweeps), model(1.03 * K, 0.97 * K3, 1.05 * C), starts=1)
    assert result.refined and result.before > 3
    assert result.after == pytest.approx(1.1, abs=0.2)  # the drive's noise passes through the structure
    for term, true in zip(result.models["joint"].terms, (K, K3, C), strict=True):
        assert abs(term.coefficient - true) < 4 * term.standard_error
        assert term.standard_error < 0.005 * true


@pytest.mark.parametrize(("refine", "starts"), [(None, 1), (False, 0), (True, 3)])
def test_only_runs_that_do_not_repeat_are_refined_unasked(monkeypatch, runs, sweeps, refine, starts):
    asked = []

    def spy(test, recoveries, models, starts, **options):
        asked.append(starts)
        return RigRefinement(False, "no start could be simulated", models, None, np.nan, np.nan)

    monkeypatch.setattr("sindyjoint.judgement.rig_discovery.refine_rig", spy)
    options = {"library": "paper", "random_state": 0}
    found = discover_rig(rig_test(sweeps), refine=refine, **options)
    assert asked == [starts] * (starts > 0)
    assert any("intervals of the regression include the sensors' noise" in line for line in found.warnings)
    if refine is None:
        assert not any("intervals" in line for line in discover_rig(rig_test(runs[:2]), **options).warnings)
        assert len(asked) == 1


def test_a_term_of_the_paper_that_the_states_do_not_tell_comes_back_by_the_response(sweeps):
    """Of a law found without k3 alone k3 returns: nothing quadratic and no friction are in the data."""
    found = discover_rig(rig_test(sweeps[1:]), refine=False, library="paper", random_state=0)
    less = replace(found, laws=(with_terms(found.laws[0], {"linear_stiffness", "linear_damping"}),))
    refine = partial(refine_rig, less.test, less.recoveries, starts=1)
    first = refine({less.laws[0].kind: less.laws[0].discovery.model})
    forbidden = ("quadratic_stiffness", "cubic_stiffness", "coulomb_friction")
    assert with_terms_of_the_response(less, first, pytest.fail, forbidden) == (less, first)
    laws, result = with_terms_of_the_response(less, first, refine)
    (own,) = result.models.values()
    assert {*own.ids} == {"linear_stiffness", "linear_damping", "cubic_stiffness"}
    assert any("told by the simulated response" in line for line in laws.laws[0].discovery.warnings)
    assert abs(own["k3"].coefficient - K3) < 3 * own["k3"].standard_error
    assert result.after < 1.2 < first.after


def test_segments_are_those_in_which_joints_move(sweeps):
    test = rig_test(sweeps[:1])
    (record,) = runs_problem(
        test, [recover(test, sweeps[0])], {"joint": model(K, K3, C)}, fitted=False
    ).records
    whole = SegmentedRun.of(test, recover(test, sweeps[0]))
    assert record.spans == whole.spans and len(whole.spans) > 1
    moving = np.zeros(sweeps[0].drive.size, dtype=bool)
    moving[whole.spans[1][0]] = True
    assert whole.where(moving).spans == whole.spans[1:2]
    last = np.arange(moving.size)
    assert whole.liveliest(last, 1).spans == whole.spans[-1:]


@pytest.fixture(scope="module")
def settled(sweeps):
    """One sweep, its segments settled at the true law, and the structure that is simulated."""
    test = rig_test(sweeps[:1])
    problem = runs_problem(test, [recover(test, sweeps[0])], {"joint": model(K, K3, C)})
    return problem.records[0], problem.simulated(problem.records[0], problem.start())


def test_states_follow_the_numbers(sweeps, settled):
    """Found with a law 5 % too soft, they leave of the true law nearly what they leave once they are found with it."""
    known, true = settled
    test = rig_test(sweeps[:1])
    problem = runs_problem(test, [recover(test, sweeps[0])], {"joint": model(0.95 * K, K3, C)})
    record = problem.records[0]
    least, there, stayed = (
        np.sum(np.concatenate(each.residual(true)) ** 2) for each in (known, record.followed(true), record)
    )
    assert stayed > 1.5 * least and there < 1.02 * least


def test_what_the_steps_leave_out_is_taken_out(settled):
    record, reduced = settled
    bare = replace(record, spread=tuple(part[:, :0] for part in record.spread))
    plain = replace(bare, missing=tuple(0 * part for part in bare.missing))
    coarse, exact, own = (
        np.concatenate(each.residual(reduced))
        for each in (plain, replace(plain, steps=16 * plain.steps), bare)
    )
    assert np.linalg.norm(coarse - exact) > 0.1
    assert np.linalg.norm(own - exact) < 0.02 * np.linalg.norm(coarse - exact)


def test_slow_errors_of_the_drive_are_projected_out(settled):
    """What is left of an error has about the power of its lines, each under its noise as prior."""
    record, reduced = settled
    record = replace(record, drive_sigma=3 * record.drive_sigma)
    known, unknown = (record.settled(reduced, driven=driven) for driven in (True, False))
    slow = slow_lines(known.measured.shape[1], known.driven / known.rate)
    error = known.drive_sigma * slow @ np.random.default_rng(0).normal(size=slow.shape[1])
    left, whole = (
        np.subtract(*(np.concatenate(e.residual(reduced)) for e in (each, with_error(each, error))))
        for each in (known, unknown)
    )
    assert np.sum(whole**2) > 5 * slow.shape[1]
    assert np.sum(left**2) < 1.2 * slow.shape[1]


def with_error(record, error):
    return replace(record, drive=record.drive + error)


def test_a_number_of_the_structure_is_fitted_to_segments(sweeps):
    """The ground spring is 4 % softer in the file, twice what it says."""
    known = refined(rig_test(sweeps[1:], **softer(0.04)), model(K, K3, C), starts=1)
    assert known.update.change[0] == pytest.approx(1 / 0.96 - 1, abs=4 * known.update.standard_error[0])
    assert known.update.standard_error[0] < 0.003 and known.after < 1.4


def test_runs_that_repeat_and_runs_that_do_not_are_refined_together(runs, sweeps):
    own, both = (
        refined(rig_test(those), model(K, K3, C), starts=1) for those in (runs[:1], [*runs[:1], sweeps[0]])
    )
    assert np.all(both.models["joint"].number_errors < own.models["joint"].number_errors)
    for term, true in zip(both.models["joint"].terms, (K, K3, C), strict=True):
        assert abs(term.coefficient - true) < 4 * term.standard_error


def test_a_law_that_does_not_explain_the_response_is_said_not_to(runs):
    result = refined(rig_test(runs), model(-50 * K, K3, C), starts=1)
    assert result.after > 100 and "lack something" in result.notes[-1]


def test_without_a_steady_motion_nothing_is_refined(runs):
    given = model(K, K3, C, -2.0)  # friction that pushes: nothing can stick
    result = refined(rig_test(runs), given)
    assert not result.refined and "no steady motion" in result.reason
    assert "not refined" in result.notes[0] and result.models["joint"] is given


@pytest.mark.parametrize("law", [PaperLaw(k1=K, k2=2e4, k3=K3, c1=C), PaperLaw(k1=K, c1=C, M_F=1.5)])
def test_the_steady_motion_balances_at_every_instant(law):
    """Put back into the equation of motion, the answer leaves nothing: checked by another way than it was found."""
    drive = np.zeros(41, dtype=complex)
    drive[1] = 6.0
    omega = 2 * np.pi * 2.5
    test = rig_test([])
    balance = steady(test.structure, (law,), test.at, test.sensors, omega, drive)
    angles = balance.solve(np.zeros(81))
    x = complex_amplitudes(angles, 1)[0]
    assert coefficients(x[None]).ravel() == pytest.approx(angles)
    first, second = balance.shown(angles) / -((omega * np.arange(1, 41)) ** 2)
    assert second - first == pytest.approx(x[1:], abs=1e-7 * abs(x[1]))
    orders = np.arange(1, 41)
    # Force in the joint by the second mass: m2·x2″ = F − f.
    force = drive[1:] - 2.0 * -((omega * orders) ** 2) * second
    time = np.linspace(0, 2 * np.pi / omega, 400, endpoint=False)
    wave = np.exp(1j * omega * np.outer(time, orders))
    d, v = (wave @ x[1:]).real + x[0].real, (wave @ (1j * omega * orders * x[1:])).real
    moving = np.abs(v) > 0.3 * np.abs(v).max()
    expected = law.moment(d, v, np.sign(v), np.zeros((0, d.size)))
    shown = (wave @ force).real
    scale = np.abs(expected).max()
    assert np.abs(shown - expected)[moving].max() < (1e-6 if not law.M_F else 0.05) * scale


def test_the_residuals_hold_the_noise_of_the_drive(runs):
    """A drive measured badly makes the laws less sure, not wrong."""
    noisy = [
        replace(run, drive=run.drive + 0.2 * np.std(run.drive) * np.random.default_rng(i).normal(size=run.drive.size))
        for i, run in enumerate(runs)
    ]  # fmt: skip
    clear, rough = (refined(rig_test(each), model(K, K3, C), starts=1) for each in (runs, noisy))
    assert rough.after < 1.3
    ratio = rough.models["joint"].number_errors / clear.models["joint"].number_errors
    assert np.all(ratio > 1.2)
    for term, true in zip(rough.models["joint"].terms, (K, K3, C), strict=True):
        assert abs(term.coefficient - true) < 4 * term.standard_error
