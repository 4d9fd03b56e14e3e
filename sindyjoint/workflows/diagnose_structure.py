"""Where a simulated structure and its pulse record disagree, and what is missing: in the joint or outside of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import Effect, load_effects
from sindyjoint.diagnosis.effects.joint import JointLaws, joint_changes
from sindyjoint.diagnosis.effects.structure import Change, Scales, load_structure_effects, structure_changes
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.diagnosis.structure.advice import advise
from sindyjoint.diagnosis.structure.hidden import hidden_pulse_test, model_of_law
from sindyjoint.diagnosis.structure.noise import record_noise
from sindyjoint.diagnosis.structure.problem import Fit, PulseProblem, fit
from sindyjoint.diagnosis.structure.result import (
    State,
    StructureDiagnosis,
    budget_of,
    held_out_gap,
    kind_of,
    model_after,
    noise_floor,
    places_of,
    record_gaps,
    verdict_of,
    warnings_of,
)
from sindyjoint.diagnosis.structure.search import FittedChange, StructureRanking, rank, rows_of, search
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.laws import PaperLaw
from sindyjoint.mechanics.pulse_test import hinges, with_laws
from sindyjoint.mechanics.rigs import Rig, load_rig, shipped_rigs
from sindyjoint.numeric import main_frequency
from sindyjoint.parallel import spread
from sindyjoint.response.model_law import model_law
from sindyjoint.response.verify_rig import MODEL_PLACE, model_places

MAX_EFFECTS = 3
# Nothing is claimed below this belief that something is missing.
BELIEF = 0.9
# An effect named before goes when without it χ² rises by less than this for each of its numbers.
NEEDLESS = 12.0


def diagnose_structure(
    rig: Rig | str | Path,
    model: JointModel | None = None,
    *,
    library: Sequence[str | Path] = (),
    effects: Sequence[Effect] | None = None,
    max_effects: int = MAX_EFFECTS,
    hold_out: Sequence[Rig | str | Path] = (),
    random_state: int | np.random.Generator | None = None,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
) -> StructureDiagnosis:
    """Find where a model in the joint of a rig and the rig's pulse record disagree, and name what is missing.

    The candidates are the effects of the joint and those outside of it: material loss, stiffness and mass of the beams,
    lumped masses, the clamp, the pulse, the displacement sensor. Each is fitted on the simulated response beside the
    model's coefficients, which keep to their covariance: a gap that these can explain is no effect.

    Parameters
    ----------
    rig : Rig, path of a rig's TOML file, or name of a shipped rig
        Its ``[measured]`` records. Without one: a virtual pulse test in which ``random_state`` hides an effect.
    model : JointModel, optional
        Default: the law that the rig gives for its joint, each term known to 0.5 %.
    library : sequence of str or Path
        Further TOML files of effects of the joint.
    effects : sequence of Effect, optional
        Candidates in the joint; default: all shipped ones and those of ``library``.
    max_effects : int
        Most effects that are added.
    hold_out : sequence of Rig or path
        Other pulses of the same structure, which no fit sees; the gaps are told on them. Default: the second half of
        the time in which the record stands out of its noise.
    random_state : int, Generator or None
        Of the virtual pulse test.
    progress : callable, optional
        Called with the name of each stage.
    jobs, workers, cluster
        Where candidates and runs to advise are tried, by default on threads of this process; see
        :func:`~sindyjoint.parallel.executor`. The result is the same to the last digit.

    Returns
    -------
    StructureDiagnosis

    Raises
    ------
    InputError, UnitError, UnknownNameError, MissingInputError
        In one line.
    """
    say = progress or (lambda stage: None)
    if max_effects < 1:
        raise InputError(f"max_effects is {max_effects}; at least 1 is wanted")
    known = load_effects(library) if effects is None else effects
    with spread(jobs, workers, cluster):
        return _diagnosed(_opened(rig), model, known, max_effects, hold_out, random_state, say)


def _diagnosed(
    rig: Rig,
    model: JointModel | None,
    effects: Sequence[Effect],
    max_effects: int,
    hold_out: Sequence[Rig | str | Path],
    random_state: int | np.random.Generator | None,
    say: Callable[[str], None],
) -> StructureDiagnosis:
    kept_out = [_opened(each) for each in hold_out]
    model, places, drawn = _model(rig, model)
    hidden = None
    if rig.measured is None:
        if kept_out:
            raise InputError(f"hold_out is given, but the rig {rig.name!r} names no measured response")
        say("simulating a virtual pulse test with something hidden in it")
        _check_true_law(rig)
        rig, hidden = hidden_pulse_test(rig, places, model, np.random.default_rng(random_state or 0), drawn)
    say("the gap")
    problem, changes, period = _problem(rig, model, places, effects)
    others = [_other(problem, each) for each in kept_out]
    state = State(problem, _first_fit(problem))
    given = state.best
    steps: list[Step] = []
    drops: list[tuple[str, float]] = []
    records = record_gaps(problem, state, others)
    before = initial = held_out_gap(records, as_given=True)
    rankings: list[StructureRanking] = []
    while len(steps) < max_effects and not (steps and _is_noise(state)):
        ranking = _ranked(state, changes, period, say)
        if ranking is None or 1 - ranking.nothing < BELIEF:
            break
        say(f"adding {ranking.fitted[0].change.effect.replace('_', ' ')}")
        cost = state.best.cost
        state = _with(state, ranking.fitted[0])
        kind = ranking.fitted[0].change
        drops.append((kind_of(kind), cost - state.best.cost))
        records = record_gaps(problem, state, others)
        after = held_out_gap(records)
        steps.append(_step(ranking, before, after))
        rankings.append(ranking)
        before = after
    steps = _retold(steps, state)
    verdict, reason = verdict_of(problem, given, state, steps)
    if verdict == "unknown":
        steps = [replace(s, probability=min(0.5 * s.probability, 0.5)) for s in steps]
    say("advice")
    advice = advise(state.problem, [r.members() for r in rankings], period)
    final = held_out_gap(records)
    return StructureDiagnosis(
        verdict=verdict, reason=reason, initial=initial, final=final, noise_floor=noise_floor(records),
        budget=budget_of(problem, given, state, drops), where=places_of(problem, verdict), steps=tuple(steps),
        advice=advice, warnings=tuple(warnings_of(rig, hidden, drawn, records, others, state)),
        model=model_after(state), effects=(), hidden=hidden, rig=rig.name, records=tuple(records),
    )  # fmt: skip


def _opened(rig: Rig | str | Path) -> Rig:
    if isinstance(rig, Rig):
        return rig
    if str(rig) in shipped_rigs():
        return load_rig(str(rig))
    return load_rig(rig, {"model": MODEL_PLACE})


def _model(rig: Rig, model: JointModel | None) -> tuple[JointModel, frozenset[str], bool]:
    """Return the model, the joints it stands for, and whether it was made of the rig's own law."""
    if model is not None:
        if model.joint.motion != "rotation":
            raise InputError("the model is of a joint in translation; the joints of a rig rotate")
        if not [term for term in model.terms if term.id != INERTIA]:
            raise InputError("the model has no terms: there is nothing to simulate; run discover first")
        return model, frozenset(model_places(rig, model)), False
    laws = {hinge.law for hinge in hinges(rig)}
    if not laws or MODEL_PLACE in laws or not all(isinstance(law, PaperLaw) for law in laws):
        raise InputError(
            f"the rig {rig.name!r} gives no law for its joint; give the model that stands there (--model)"
        )
    law = hinges(rig)[0].law
    try:
        motion = rig.respond()
    except SimulationError as error:
        raise InputError(f"the rig {rig.name!r} cannot be simulated: {error}") from error
    assert isinstance(law, PaperLaw)
    size = [float(np.abs(x).max(initial=0.0)) for x in (motion.angle, motion.rate)]
    places = frozenset(h.name for h in hinges(rig) if h.law == law)
    return model_of_law(law, *size), places, True


def _check_true_law(rig: Rig) -> None:
    if any(hinge.law is MODEL_PLACE for hinge in hinges(rig)):
        raise InputError(
            f"the rig {rig.name!r} has a joint whose law is 'model' and no measured response: a virtual test needs the "
            "true law; add a [measured] table, or name a shipped joint as the law"
        )


def _problem(
    rig: Rig, model: JointModel, places: frozenset[str], effects: Sequence[Effect]
) -> tuple[PulseProblem, tuple[Change, ...], float]:
    """Return the problem, its candidates and the period of the main oscillation, s."""
    assert rig.measured is not None
    records = (rig.measured, *rig.also_measured)
    noise = tuple(record_noise(r.displacement, r.sample_rate) for r in records)
    law = model_law(model)
    laws = JointLaws(model, getattr(law, "softening_limit", (-np.inf, np.inf)))
    problem = PulseProblem(rig, places, model, laws, records, noise, pulse_uncertainty=rig.pulse_uncertainty)
    in_place = with_laws(rig, lambda hinge: law if hinge.name in places else hinge.law)
    try:
        motion = in_place.respond(duration=problem.duration)
    except SimulationError as error:
        raise InputError(f"the rig {rig.name!r} cannot be simulated with the model: {error}") from error
    rows = [i for i, hinge in enumerate(hinges(rig)) if hinge.name in places]
    angle, rate, moment = (float(np.abs(x[rows]).max()) for x in (motion.angle, motion.rate, motion.moment))
    problem = _with_step_error(problem, problem.start())
    period = 1 / main_frequency(records[0].displacement, records[0].sample_rate)
    scales = Scales(period, float(np.std(records[0].displacement)), problem.duration)
    setup = problem.setup(problem.start())
    outside = structure_changes(load_structure_effects(), setup, scales)
    return problem, (*outside, *joint_changes(laws, effects, Reference(angle, rate), moment)), period


def _with_step_error(problem: PulseProblem, x: np.ndarray) -> PulseProblem:
    """Return the problem with what the time step does to the response, by Richardson's rule for order two."""
    setup = problem.setup(x)
    whole = problem.simulate(setup, problem.duration)
    half = problem.simulate(setup, problem.duration, 0.5 * problem.rig.step)
    if whole is None or half is None:
        return replace(problem, step_error=())
    return replace(problem, step_error=tuple(4 / 3 * (b - a) for a, b in zip(whole, half, strict=True)))


def _other(problem: PulseProblem, rig: Rig) -> PulseProblem:
    """Return the problem of another pulse of the same structure."""
    if rig.measured is None:
        raise InputError(f"the rig {rig.name!r} of hold_out names no measured response")
    if [type(i) for i in rig.items] != [type(i) for i in problem.rig.items]:
        raise InputError(f"the rig {rig.name!r} of hold_out has another chain than {problem.rig.name!r}")
    records = (rig.measured, *rig.also_measured)
    noise = tuple(record_noise(r.displacement, r.sample_rate) for r in records)
    return replace(problem, rig=rig, records=records, noise=noise, step_error=(), _kept={})


def _first_fit(problem: PulseProblem) -> Fit:
    # Whole cycles off, the model's coefficients only follow the gap: a few parts in a hundred are not worth the time.
    best = fit(problem, problem.start(), problem.duration, iterations=4, relative=0.02)
    if best is None:
        raise InputError(
            f"the rig {problem.rig.name!r} cannot be simulated with the model and its uncertainty"
        )
    return best


def _ranked(
    state: State, changes: Sequence[Change], period: float, say: Callable[[str], None]
) -> StructureRanking | None:
    taken = {each.change.effect for each in state.named}
    candidates = [change for change in changes if change.effect not in taken]
    fitted = search(state.problem, state.best, candidates, period, say)
    explained = sum(each.gain for each in state.named)
    return rank(fitted, state.best.cost, rows_of(state.problem), explained) if fitted else None


def _with(state: State, best: FittedChange) -> State:
    """Return the state with another effect; earlier ones that it makes needless go."""
    problem = replace(state.problem, found=(*state.problem.found, best.change))
    named = (*state.named, best)
    x = best.x
    problem = _with_step_error(problem, x)
    found = fit(problem, x, problem.duration, iterations=4)
    if found is None:
        return state
    for each in state.named:
        at = problem.priors + sum(c.size for c in problem.found[: problem.found.index(each.change)])
        fewer = replace(problem, found=tuple(c for c in problem.found if c is not each.change))
        less = fit(
            fewer, np.delete(found.x, range(at, at + each.change.size)), problem.duration, iterations=4
        )
        if less is not None and less.cost - found.cost < NEEDLESS * each.change.size:
            problem, found = fewer, less
            named = tuple(n for n in named if n is not each)
    return State(problem, found, named)


def _is_noise(state: State) -> bool:
    """Return whether what is left is noise, as surely as the noise itself is known (from the late part)."""
    rows = rows_of(state.problem)
    return state.best.cost / rows < 1 + 3 * float(np.sqrt(7 / rows))


def _step(ranking: StructureRanking, before: Gap, after: Gap) -> Step:
    best = ranking.fitted[0]
    pairs = zip(ranking.fitted[1:], ranking.probabilities[1:], strict=True)
    others = [(f.change.effect, p) for f, p in pairs if p > 1e-4]
    return Step(
        effect=best.change.effect, family=best.change.family,
        members=tuple(f.change.effect for f in ranking.members()), probability=ranking.probabilities[0],
        rivals=tuple(others[:6]), parameters=best.parameters, terms_dropped=(), gap_before=before, gap_after=after,
        units=best.change.units,
    )  # fmt: skip


def _retold(steps: Sequence[Step], state: State) -> list[Step]:
    """Return the steps whose effects stayed, with the numbers of the last fit."""
    told = []
    for step in steps:
        at = state.problem.priors
        for change in state.problem.found:
            own = state.best.x[at : at + change.size]
            at += change.size
            if change.effect == step.effect:
                numbers = {k: float(v) for k, v in change.report(own).items()}
                told.append(replace(step, parameters=numbers, units=change.units))
    return told
