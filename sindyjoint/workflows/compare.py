"""The same question put to every selector, every frequency and every library."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sindyjoint.discovery.crossvalidation import CrossValidation, Fold, Found, cross_validate, find
from sindyjoint.discovery.evidence import Evidence
from sindyjoint.discovery.methods import METHODS, NOT_GIVEN
from sindyjoint.discovery.policy import POLICY as DISCOVERY
from sindyjoint.discovery.selection import Selection
from sindyjoint.discovery.uncertainty import inclusion
from sindyjoint.equation.catalogue import as_catalogue
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import read_model
from sindyjoint.equation.without_rate import rate_free
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.inputs import run_levels
from sindyjoint.judgement.comparison import Choice, ChosenTerm, Comparison, SizeScore
from sindyjoint.judgement.discovery import Discovery, undetermined
from sindyjoint.judgement.held_out_response import add_responses
from sindyjoint.judgement.independence import frequency_tests
from sindyjoint.options import checks_options
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.parallel import side_by_side, spread
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import require_sound
from sindyjoint.threads import single_threaded
from sindyjoint.workflows.discover import discover, regressor_options
from sindyjoint.workflows.verify import given_model

# Each name may join several catalogues: without the terms of the paper, special ones stand in for those.
LIBRARIES = ("paper", "polynomial", "paper + stiffness", "paper + damping", "paper + friction", "extended")
# Over the angles of such joints sin θ is θ: no test tells gravity from stiffness.
NEVER_VISIBLE = ("gravity_moment",)
REPLICATES = 500
# Not a method of its own but the same rows in weak form: only where it is asked for.
WEAK = "weak"


@checks_options(lambda: (*inspect.signature(discover).parameters, *regressor_options()))
@single_threaded()
def compare(
    campaign: Campaign | str | Path | None = None,
    library: Any = "extended",
    *,
    model: JointModel | str | Path | None = None,
    accept: Sequence[str] = (),
    methods: Sequence[str] | None = None,
    libraries: Sequence[str] = LIBRARIES,
    replicates: int = REPLICATES,
    margin: float = DISCOVERY.frequency_margin,
    random_state: Any = 0,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    **options: Any,
) -> Comparison:
    """Compare what methods, frequencies and libraries say about a joint's terms.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, or None
        ``None``: the built-in virtual test of the inter-panel joint, which is simulated.
    library : str, Path, Catalogue, or sequence of these
        Candidates for the comparison of methods and of frequencies.
    model : JointModel or path of a model.json, optional
        A model that is held against the same runs, elements and errors of their channels included; as
        :func:`~sindyjoint.verify` does.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`.
    methods : sequence of str, optional
        Of :data:`~sindyjoint.discovery.methods.METHODS`, default: all; and ``"weak"``, after another one: its way of
        choosing, on the weak form of the rows by pysindy's test functions.
    libraries : sequence of str
        Names of catalogues, several joined by "+", for the first method.
    replicates : int
        Of the bootstrap behind the inclusion probabilities.
    margin : float
        Relative change of a coefficient over the tested band that would not matter.
    random_state : int, Generator or None
    progress : callable, optional
        Called with the name of each stage.
    jobs, workers, cluster
        Where methods and replicates are worked on, to the same digits; see :func:`~sindyjoint.parallel.executor`.
    **options
        Of :func:`~sindyjoint.workflows.discover.discover`: states, bandwidth, align, forbidden, ...

    Raises
    ------
    InputError, UnknownNameError
        For data or options that cannot be used.
    UnsoundError
        Where the check of the data finds what stops the work.
    """
    options["accept"] = accept
    names = _checked(tuple(methods or METHODS))
    if replicates < 10 or not margin > 0:
        raise InputError(
            f"{replicates} replicates and a margin of {margin!r} given; expected at least 10 and a positive one"
        )
    if isinstance(model, str | Path):
        read_model(model)  # what cannot be read is refused before anything is worked on
    # Each method has the same seed, whichever is done first.
    if isinstance(random_state, np.random.Generator):
        random_state = int(random_state.integers(2**32))
    clock = _Clock(progress or (lambda stage: None))
    with spread(jobs, workers, cluster):
        found = clock.run(
            "discovering", discover, campaign, library, random_state=random_state, method=names[0],
            progress=progress, **options,
        )  # fmt: skip
        if found.stopped is not None:
            require_sound(found.stopped)
        compared = _compared(found, names, libraries, replicates, margin, random_state, options, clock)
    if model is None:
        return compared
    return replace(
        compared,
        given=clock.run(
            "simulating the given model", given_model, model, found.measured or found.campaign, accept
        ),
    )


def _checked(names: tuple[str, ...]) -> tuple[str, ...]:
    unknown = [name for name in names if name not in (*METHODS, WEAK)]
    if unknown:
        raise UnknownNameError(f"method is {unknown[0]!r}; expected one of {', '.join((*METHODS, WEAK))}")
    if names[0] == WEAK:
        raise InputError(f"{WEAK!r} cannot lead the comparison: name another method before it")
    return names


def _compared(
    found: Discovery,
    names: tuple[str, ...],
    libraries: Sequence[str],
    replicates: int,
    margin: float,
    random_state: Any,
    options: dict[str, Any],
    clock: _Clock,
) -> Comparison:
    evidence = found.regressor.evidence_
    rule: dict[str, Any] = {
        "significance": found.regressor.significance,
        "least_share": found.regressor.least_share_,
    }
    by_method = clock.run("methods", _methods, found, names, random_state, rule)
    parts = _parts(found)
    by_frequency = clock.run(
        f"one {parts} at a time", _frequencies, found, evidence, names[0], random_state, rule
    )
    by_library = clock.run("libraries", _libraries, found, libraries, names[0], random_state, options)
    left_out = clock.run(
        "holding out frequencies and levels", _hold_out_groups, found, evidence, names[0], random_state, rule
    )
    by_method = clock.run("simulating held-out runs", add_responses, found, evidence, by_method)
    included = clock.run(
        "resampling blocks and runs", inclusion, evidence, replicates, random_state=random_state, **rule
    )
    model, bias = _model(found)
    tests = clock.run("frequency dependence", frequency_tests, found, found.bias, margin)
    return Comparison(
        joint=found.campaign.joint.name,
        motion=found.campaign.joint.motion,
        simulated=found.campaign.simulated,
        ids=evidence.ids,
        units=_units(found, by_library),
        methods=by_method,
        frequencies=by_frequency,
        libraries=tuple(choice for choice, _ in by_library),
        inclusion=tuple(float(p) for p in included.probability),
        sets=included.sets,
        left_out=left_out,
        tests=tests,
        bias=bias,
        model=model,
        undetermined=undetermined(found),
        warnings=found.warnings
        + tuple(f"weak form: {c.reason}" for c in by_method if c.name == WEAK and not c.terms),
        seconds=clock.seconds,
        discovery=found,
        soundness=found.soundness,
        noise_floor=found.model.fitted.noise_floor / (found.model.fitted.moment_rms or 1.0),
        parts=parts,
    )


def _parts(found: Discovery) -> Literal["frequency", "level", "run"]:
    """Return what runs are grouped by."""
    groups = set(found.regressor.evidence_.groups)
    if all(group.endswith(" Hz") for group in groups) and any(state.frequency for state in found.states):
        return "frequency"
    return "level" if groups == {state.level for state in found.states} else "run"


class _Clock:
    """Names the stages as they begin and keeps the time that each takes."""

    def __init__(self, say: Callable[[str], None]):
        self.say = say
        self.seconds: dict[str, float] = {}

    def run(self, stage: str, work: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        self.say(stage)
        started = time.perf_counter()
        result = work(*arguments, **options)
        self.seconds[stage] = time.perf_counter() - started
        return result


def _methods(
    found: Discovery, names: Sequence[str], random_state: Any, rule: dict[str, Any]
) -> tuple[Choice, ...]:
    """Return what each method finds; the weak form has rows of its own and the first method's way through them."""
    evidence = found.regressor.evidence_
    plain = [name for name in names if name != WEAK]
    done = side_by_side(_method, plain, [evidence, random_state, rule], threads=False)
    by_name = dict(zip(plain, done, strict=True))
    if WEAK in names:
        by_name[WEAK] = _weak(found, names[0], random_state, rule)
    return tuple(by_name[name] for name in names)


def _weak(found: Discovery, method: str, random_state: Any, rule: dict[str, Any]) -> Choice:
    """Return what the weak form finds."""
    from sindyjoint.discovery.weak import weak_evidence

    start, terms = time.perf_counter(), found.regressor.terms_
    try:
        evidence = weak_evidence(terms, found.states, found.campaign.joint.inertia)
    except InputError as cause:
        # The other methods have their answers.
        return Choice(WEAK, (), str(cause), len(terms))
    fixed, spent = found.regressor.fixed, time.perf_counter() - start
    evidence = evidence.fixing(fixed) if fixed else evidence
    choice = _method(evidence, random_state, rule, method)
    held_out = choice.held_out
    if np.isfinite(held_out):
        folds = cross_validate(evidence, method=method, random_state=random_state, **rule).folds
        held_out = _sample_error(folds, found.regressor.evidence_)
    # Its residual is one of integrals, which compares with no other.
    return replace(
        choice, name=WEAK, seconds=choice.seconds + spent, held_out=held_out, residual=float("nan")
    )


def _sample_error(folds: Sequence[Fold], samples: Evidence) -> float:
    """Return the error of held-out samples of the moment, as of the other methods, not of its integrals."""
    errors = []
    for fold in folds:
        coefficients = np.zeros(len(samples.ids))
        coefficients[[samples.ids.index(name) for name in fold.kept]] = fold.coefficients
        held_out = [run.pooled for run in samples.runs if run.name in fold.runs]
        total = sum(factor.squared_target for factor in held_out)
        errors.append(sum(factor.squared_error(coefficients) for factor in held_out) / total)
    return float(np.sqrt(np.mean(errors)))


def _method(evidence: Evidence, random_state: Any, rule: dict[str, Any], name: str) -> Choice:
    start = time.perf_counter()
    found = find(evidence, name, random_state, **rule)
    seconds = time.perf_counter() - start
    held_out = float("nan")
    if len(evidence.groups) > 1:
        held_out = cross_validate(evidence, method=name, random_state=random_state, **rule).moment_error
    target = evidence.target_rms
    path = tuple(
        SizeScore(
            step.size,
            tuple(found.candidates[c] for c in step.columns),
            step.fit.residual_rms / target,
            step.held_out_rms / target,
        )
        for step in found.selection.path
    )
    return Choice(
        name, _terms(found), found.selection.reason, len(found.candidates), seconds, held_out, path=path,
        not_given=NOT_GIVEN[name], residual=_residual(found.selection, target),
    )  # fmt: skip


def _residual(selection: Selection, target: float) -> float:
    """Return the residual of the chosen model relative to the RMS of what was fitted; NaN without one."""
    return selection.step.fit.residual_rms / target if selection.step is not None else float("nan")


def _terms(found: Found) -> tuple[ChosenTerm, ...]:
    from scipy.special import stdtrit

    step = found.selection.step
    if step is None:
        return ()
    half = stdtrit(np.maximum(step.fit.effective_degrees, 1.0), 0.975) * found.standard_errors
    return tuple(
        ChosenTerm(name, float(c), float(e), (float(c - h), float(c + h)))
        for name, c, e, h in zip(found.kept, found.coefficients, found.standard_errors, half, strict=True)
    )


def _frequencies(
    found: Discovery, evidence: Evidence, method: str, random_state: Any, rule: dict[str, Any]
) -> tuple[Choice, ...]:
    """Select terms from the runs of each single group; the parts of a single run are no frequencies."""
    if len(found.states) < 2:
        return ()
    choices = []
    for group in evidence.groups:
        single = find(evidence.only([group]), method, random_state, **rule)
        left = _residual(single.selection, evidence.only([group]).target_rms)
        choices.append(
            Choice(group, _terms(single), single.selection.reason, len(single.candidates), residual=left)
        )
    return tuple(choices)


def _libraries(
    found: Discovery, libraries: Sequence[str], method: str, random_state: Any, options: dict[str, Any]
) -> tuple[tuple[Choice, dict[str, str]], ...]:
    """Fit each library to the force states that are there already; return choices and the units of their terms."""
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.states import regression_rows

    rows = regression_rows(found.states, found.campaign.joint.inertia).fit_arguments()
    result = []
    for name in libraries:
        catalogue = as_catalogue([part.strip() for part in name.split("+")])
        catalogue = rate_free(catalogue) if found.campaign.quasi_static else catalogue
        forbidden = [term for term in (*options.get("forbidden", ()), *NEVER_VISIBLE) if term in catalogue]
        regressor = JointRegressor(
            catalogue,
            method=method,
            forbidden=forbidden,
            motion=found.campaign.joint.motion,
            inputs=found.regressor.inputs,
            random_state=random_state,
        ).fit(**rows)
        terms = tuple(
            ChosenTerm(t.id, t.coefficient, t.standard_error, t.interval95) for t in regressor.model_.terms
        )
        offered = all(term in regressor.evidence_.ids for term in PAPER_TERMS)
        reason = regressor.selection_result_.reason
        left = _residual(regressor.selection_result_, regressor.evidence_.target_rms)
        choice = Choice(name, terms, reason, len(regressor.terms_), offers_paper_terms=offered, residual=left)
        result.append((choice, {t.id: t.unit for t in regressor.model_.terms}))
    return tuple(result)


def _hold_out_groups(
    found: Discovery, evidence: Evidence, method: str, random_state: Any, rule: dict[str, Any]
) -> dict[str, CrossValidation]:
    """Leave out frequencies, levels, and levels of each input, where there are several; of a single run its parts."""
    result = {}
    if len(evidence.groups) > 1:
        kind = _parts(found) if len(found.states) > 1 else "time"
        result[kind] = cross_validate(evidence, method=method, random_state=random_state, **rule)
    levels = [state.level or state.run for state in found.states]
    if "level" not in result and len(levels) == len(evidence.runs) and 1 < len(set(levels)) < len(levels):
        result["level"] = cross_validate(evidence, levels, method=method, random_state=random_state, **rule)
    for each in found.campaign.inputs:
        at = run_levels({s.run: s.inputs[each.name] for s in found.states}, each.tested)
        named = [each.shown(at[run.name]) for run in evidence.runs if run.name in at]
        if len(named) == len(evidence.runs) and len(set(named)) > 1:
            result[each.label] = cross_validate(
                evidence, named, method=method, random_state=random_state, **rule
            )
    return result


def _model(found: Discovery) -> tuple[Choice, dict[str, float]]:
    """Return the main model, and the bias that was taken out of its coefficients."""
    measured = {} if found.bias is None else dict(zip(found.bias.ids, found.bias.pooled, strict=True))
    terms = tuple(ChosenTerm(t.id, t.coefficient, t.standard_error, t.interval95) for t in found.model.terms)
    fitted = found.model.fitted
    left = fitted.residual_rms / (fitted.moment_rms or 1.0)
    return (
        Choice("model", terms, found.reason, len(found.regressor.terms_), residual=left),
        {name: float(value) for name, value in measured.items()},
    )


def _units(found: Discovery, by_library: Sequence[tuple[Choice, dict[str, str]]]) -> dict[str, str]:
    motion = found.campaign.joint.motion
    units = {term.id: term.term.unit_for(motion) for term in found.regressor.terms_}
    for _, more in by_library:
        units.update(more)
    return units
