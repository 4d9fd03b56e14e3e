"""One question, which terms the joint has, put to every method, frequency and library on the same evidence."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import scipy

from sindyjoint.discovery import Evidence, Fit, fit_columns
from sindyjoint.discovery.factors import dependent_columns
from sindyjoint.discovery.methods import NOT_GIVEN
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.discovery.selection import Selection
from sindyjoint.discovery.uncertainty import (
    CrossValidation,
    Found,
    cross_validate,
    find,
    moment_error,
    pooled_error,
)
from sindyjoint.equation.candidates import dependences, rate_free
from sindyjoint.equation.catalogue import Catalogue, as_catalogue, load_catalogue
from sindyjoint.equation.model import JointModel, model_terms
from sindyjoint.errors import InputError
from sindyjoint.inputs import run_levels
from sindyjoint.judgement.comparison import Choice, ChosenTerm, SizeScore
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.over_inputs import changed_term
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.parallel import side_by_side
from sindyjoint.states import regression_rows, with_later_motion


def wanted_terms(found: Discovery) -> tuple[str, ...]:
    """Return the paper's terms that the samples can show."""
    without_time = found.campaign.quasi_static
    paper = rate_free(load_catalogue("paper")).ids if without_time else PAPER_TERMS
    return tuple(term for term in PAPER_TERMS if term in paper)


def against_paper(found: Discovery, choice: Choice) -> Choice:
    """Return a choice that knows which terms of the paper it is held against, and which of its own change those."""
    changes = {
        item.id: changed_term(item.term.expression) for item in found.regressor.terms_ if item.term.inputs
    }
    own = tuple((name, term) for name in choice.ids if (term := changes.get(name)) is not None)
    return replace(choice, wanted=wanted_terms(found), dependences=own)


# Over the angles of such joints sin θ is θ: no test distinguishes gravity from stiffness.
NEVER_VISIBLE = ("gravity_moment",)
# Not a method of its own but the same rows in weak form: only where it is asked for.
WEAK = "weak"


@dataclass(frozen=True, eq=False)
class Question:
    """What is put to every method, frequency and library.

    Parameters
    ----------
    found : Discovery
    names : tuple of str
        Of the methods; the first one leads.
    random_state : int or None
    rule : dict
        How a model is chosen on a path.
    """

    found: Discovery
    names: tuple[str, ...]
    random_state: Any
    rule: dict[str, Any]

    @classmethod
    def of(cls, found: Discovery, names: tuple[str, ...], random_state: Any) -> "Question":
        """Return the question with the rule of a discovery."""
        regressor = found.regressor
        rule = {"significance": regressor.significance, "least_share": regressor.least_share_}
        return cls(found, names, random_state, rule)

    @property
    def evidence(self) -> Evidence:
        """Of the discovery."""
        return self.found.regressor.evidence_

    def choice(self, evidence: Evidence, name: str) -> Choice:
        """Return what a method finds."""
        return _method(evidence, self.random_state, self.rule, name)

    def left_out(self, evidence: Evidence, labels: Sequence[str] | None = None) -> CrossValidation:
        """Return what the first method finds without the runs of each label."""
        return cross_validate(
            evidence, labels, method=self.names[0], random_state=self.random_state, **self.rule
        )


def parts_of(found: Discovery) -> Literal["frequency", "level", "run"]:
    """Return what runs are grouped by."""
    groups = set(found.regressor.evidence_.groups)
    if all(group.endswith(" Hz") for group in groups) and any(state.frequency for state in found.states):
        return "frequency"
    return "level" if groups == {state.level for state in found.states} else "run"


def by_method(question: Question) -> tuple[Choice, ...]:
    """Return what each method finds; the weak form has rows of its own and the first method's way through them."""
    plain = [name for name in question.names if name != WEAK]
    method = partial(_method, question.evidence, question.random_state, question.rule)
    by_name = dict(zip(plain, side_by_side(method, plain, threads=False), strict=True))
    if WEAK in question.names:
        by_name[WEAK] = _weak(question)
    return tuple(by_name[name] for name in question.names)


def _weak(question: Question) -> Choice:
    """Return what the weak form finds."""
    from sindyjoint.discovery.library import weak_evidence

    found = question.found
    start, terms = time.perf_counter(), found.regressor.terms_
    try:
        evidence = weak_evidence(terms, found.states, found.campaign.joint.inertia)
    except InputError as cause:
        # The other methods have their answers.
        return Choice(WEAK, (), str(cause), len(terms))
    fixed, spent = found.regressor.fixed, time.perf_counter() - start
    evidence = evidence.fixing(fixed) if fixed else evidence
    choice = question.choice(evidence, question.names[0])
    held_out = choice.held_out, choice.held_out_error
    if np.isfinite(choice.held_out):
        # Of held-out samples of the moment, as of the other methods, not of its integrals.
        folds = question.left_out(evidence).folds
        held_out = pooled_error(
            [
                moment_error(question.evidence, f.runs, dict(zip(f.kept, f.coefficients, strict=True)))
                for f in folds
            ]
        )
    # Its residual is one of integrals, which compares with no other.
    return _scored(
        replace(choice, name=WEAK, seconds=choice.seconds + spent, residual=float("nan")), held_out
    )


def _scored(choice: Choice, held_out: tuple[float, float]) -> Choice:
    return replace(choice, held_out=held_out[0], held_out_error=held_out[1])


def _held_out(
    evidence: Evidence, name: str, random_state: Any, rule: Mapping[str, Any]
) -> tuple[float, float]:
    """Return the error of what is held out group by group, and its standard error; NaN of a single group."""
    if len(evidence.groups) < 2:
        return float("nan"), float("nan")
    folds = cross_validate(evidence, method=name, random_state=random_state, **rule).folds
    return pooled_error([fold.moment_error for fold in folds])


def _method(evidence: Evidence, random_state: Any, rule: dict[str, Any], name: str) -> Choice:
    start = time.perf_counter()
    found = find(evidence, name, random_state, **rule)
    seconds = time.perf_counter() - start
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
    choice = Choice(
        name, _terms(found), found.selection.reason, len(found.candidates), seconds, path=path,
        not_given=NOT_GIVEN[name], residual=_residual(found.selection, target),
    )  # fmt: skip
    return _scored(choice, _held_out(evidence, name, random_state, rule))


def _residual(selection: Selection, target: float) -> float:
    """Return the residual of the chosen model relative to the RMS of what was fitted; NaN without one."""
    return selection.step.fit.residual_rms / target if selection.step is not None else float("nan")


def _terms(found: Found) -> tuple[ChosenTerm, ...]:
    return () if found.selection.step is None else _chosen(found.law, found.selection.step.fit)


def _chosen(law: Mapping[str, float], fit: Fit) -> tuple[ChosenTerm, ...]:
    half = scipy.special.stdtrit(np.maximum(fit.effective_degrees, 1.0), 0.975) * fit.standard_errors
    return tuple(
        ChosenTerm(name, float(c), float(e), (float(c - h), float(c + h)))
        for (name, c), e, h in zip(law.items(), fit.standard_errors, half, strict=True)
    )


def by_group(question: Question, labels: Sequence[str] | None = None) -> tuple[Choice, ...]:
    """Select terms from the runs of each single group, or label; score them on the runs of the others.

    The parts of a single run are no frequencies.
    """
    if len(question.found.states) < 2:
        return ()
    runs = question.evidence.runs
    members: dict[str, list[int]] = {}
    for index, label in enumerate(labels or [run.group for run in runs]):
        members.setdefault(label, []).append(index)
    choices = []
    for group, rows in members.items():
        evidence = replace(question.evidence, runs=tuple(runs[i] for i in rows))
        single = find(evidence, question.names[0], question.random_state, **question.rule)
        left = _residual(single.selection, evidence.target_rms)
        choice = Choice(group, _terms(single), single.selection.reason, len(single.candidates), residual=left)
        law = {term.id: term.coefficient for term in choice.terms}
        others = [{runs[i].name for i in each} for name, each in members.items() if name != group]
        errors = [moment_error(question.evidence, each, law) for each in others if law]
        choices.append(_scored(choice, pooled_error(errors)))
    return tuple(choices)


def by_level(question: Question) -> tuple[Choice, ...]:
    """Select terms from the runs of each single level, where groups are not levels and runs share them."""
    levels = _levels(question)
    return by_group(question, levels) if levels and parts_of(question.found) != "level" else ()


def _levels(question: Question) -> list[str]:
    """Return the level of each run; empty where there are not several that runs share."""
    levels = [state.level or state.run for state in question.found.states]
    shared = len(levels) == len(question.evidence.runs) and 1 < len(set(levels)) < len(levels)
    return levels if shared else []


def by_library(
    question: Question, libraries: Sequence[str], forbidden: Sequence[str]
) -> tuple[tuple[Choice, dict[str, str]], ...]:
    """Fit each library to the force states that are there already; return choices and the units of their terms."""
    found = question.found
    result = []
    for name in libraries:
        catalogue = as_catalogue([part.strip() for part in name.split("+")])
        catalogue = rate_free(catalogue) if found.campaign.quasi_static else catalogue
        regressor = _offered(
            question, catalogue, [term for term in (*forbidden, *NEVER_VISIBLE) if term in catalogue]
        )
        terms = ChosenTerm.of(regressor.model_)
        offered = all(term in regressor.evidence_.ids for term in wanted_terms(found))
        reason = regressor.selection_result_.reason
        left = _residual(regressor.selection_result_, regressor.evidence_.target_rms)
        choice = Choice(name, terms, reason, len(regressor.terms_), offers_paper_terms=offered, residual=left)
        rule = {"significance": regressor.significance, "least_share": regressor.least_share_}
        held_out = _held_out(regressor.evidence_, question.names[0], question.random_state, rule)
        choice = _scored(choice, held_out)
        result.append((choice, {t.id: t.unit for t in regressor.model_.terms}))
    return tuple(result)


def _offered(question: Question, catalogue: Catalogue, forbidden: Sequence[str]) -> TermRegression:
    """Return the regression on a catalogue of the force states that are there already."""
    found = question.found
    return TermRegression(
        library=catalogue,
        method=question.names[0],
        forbidden=forbidden,
        motion=found.campaign.joint.motion,
        inputs=found.regressor.inputs,
        random_state=question.random_state,
    ).fit(**regression_rows(found.states, found.campaign.joint.inertia).fit_arguments())


def by_friction_law(question: Question) -> tuple[tuple[Choice, ...], dict[str, str]]:
    """Fit laws of friction under a load, the rest of the found law beside each; score them on held-out groups.

    Dry friction alone, then models M1 to M6 of Duclusaud et al. (2024): viscous, Stribeck, load, both, a load that acts
    otherwise against the motion than with it, and a load's square; linear in their coefficients, of which M5's and M6's
    part at low rates does not depend on the direction. Empty where no input is a force, a moment or a pressure. With
    the units of the terms.
    """
    found = question.found
    drag, stribeck = ("coulomb_friction", "linear_damping"), "stribeck_friction"
    other = {drag[1], *(f"moment_by_{each.name}" for each in found.campaign.inputs)}
    rest = [
        term.term
        for term in found.regressor.terms_
        if term.id in found.model.ids and term.term.family != "friction" and term.id not in other
    ]
    loads = dependences(found.campaign.inputs, (), "loads")
    if not loads.terms or len(question.evidence.groups) < 2:
        return (), {}
    known = load_catalogue("extended")
    catalogue = Catalogue("", "", (*rest, *(known[name] for name in (*drag, stribeck)))).union(loads)
    regression = _offered(question, catalogue, ())
    evidence = regression.evidence_
    laws = {"Coulomb": drag[:1], "M1 viscous": drag, "M2 Stribeck": (*drag, stribeck)}
    for each in found.campaign.inputs:
        load = f"coulomb_friction_proportional_to_{each.name}"
        both = (*drag, stribeck, load, f"stribeck_friction_proportional_to_{each.name}")
        directional = (*both, f"moment_by_{each.name}")
        laws[f"M3 {each.name}"] = (*drag, load)
        laws[f"M4 {each.name}, Stribeck"] = both
        laws[f"M5 {each.name}, direction"] = directional
        laws[f"M6 {each.name}, squared"] = (*directional, f"{load}_squared")
    left = [term.id for term in rest if term.id in evidence.ids]
    fitted = [
        _fitted(evidence, name, (*left, *law)) for name, law in laws.items() if {*law} <= {*evidence.ids}
    ]
    return tuple(fitted), {t.id: t.term.unit_for(found.campaign.joint.motion) for t in regression.terms_}


def _fitted(evidence: Evidence, name: str, terms: Sequence[str]) -> Choice:
    """Return given terms as a choice, with their error on each held-out group."""
    columns = [evidence.ids.index(term) for term in terms]
    errors = []
    for group in evidence.groups:
        others = _fitted_without(evidence, group, columns)
        law = {} if others is None else dict(zip(terms, others.coefficients, strict=True))
        runs = {run.name for run in evidence.runs if run.group == group}
        errors.append(moment_error(evidence, runs, law) if law else float("nan"))
    fit = fit_columns(evidence, columns)
    chosen = _chosen(dict(zip(terms, fit.coefficients, strict=True)), fit)
    choice = Choice(name, chosen, "given", len(terms), residual=fit.residual_rms / evidence.target_rms)
    return _scored(choice, pooled_error(errors))


def _fitted_without(evidence: Evidence, group: str, columns: Sequence[int]) -> Fit | None:
    """Return the fit of some columns to all groups but one; None where these do not tell them apart."""
    rest = evidence.only([each for each in evidence.groups if each != group])
    return None if dependent_columns(rest.pooled.take(columns)) else fit_columns(rest, columns)


def hold_out_groups(question: Question) -> dict[str, CrossValidation]:
    """Leave out frequencies, levels, and levels of each input, where there are several; of a single run its parts."""
    found, evidence = question.found, question.evidence
    result: dict[str, CrossValidation] = {}
    if len(evidence.groups) > 1:
        kind = parts_of(found) if len(found.states) > 1 else "time"
        result[kind] = question.left_out(evidence)
    if "level" not in result and (levels := _levels(question)):
        result["level"] = question.left_out(evidence, levels)
    for each in found.campaign.inputs:
        at = run_levels({s.run: s.inputs[each.name] for s in found.states}, each.tested)
        named = [each.shown(at[run.name]) for run in evidence.runs if run.name in at]
        if len(named) == len(evidence.runs) and len(set(named)) > 1:
            result[each.label] = question.left_out(evidence, named)
    return result


def add_responses(found: Discovery, evidence: Evidence, choices: tuple[Choice, ...]) -> tuple[Choice, ...]:
    """Add the error of the simulated response of held-out frequencies, each distinct set of terms once."""
    known: dict[tuple[str, ...], tuple[float, str]] = {(): (float("nan"), "no model")}
    for choice in choices:
        if choice.ids not in known:
            known[choice.ids] = response_error(found, evidence, choice.ids)
    return tuple(
        replace(choice, response=known[choice.ids][0], not_simulated=known[choice.ids][1])
        for choice in choices
    )


def response_error(found: Discovery, evidence: Evidence, ids: tuple[str, ...]) -> tuple[float, str]:
    """Return the error of a set of terms, and why there is none; each run under the fit to the other groups."""
    from sindyjoint.response.laws import law_in_run
    from sindyjoint.response.run import simulate_run

    # The groups of a single run are parts of it, and a part has no steady response to compare with.
    if len(found.states) < 2:
        return float("nan"), "one run only: no other one can be held out"
    columns = [evidence.ids.index(name) for name in ids]
    runs = {run.name: with_later_motion(run, found.lag) for run in found.campaign.identification_runs}
    states = {state.run: state for state in found.states}
    errors = []
    for group in evidence.groups:
        fit = _fitted_without(evidence, group, columns)
        if fit is None:
            return float("nan"), f"without {group} the runs do not tell its terms apart"
        own = [run.name for run in evidence.runs if run.group == group]
        try:
            fitted = _fitted_model(found, ids, fit)
            laws = {name: law_in_run(fitted, states[name]) for name in own}
        except InputError as cause:
            return float("nan"), str(cause)
        for name, law in laws.items():
            simulated = simulate_run(law, runs[name], states[name], response_only=True)
            if simulated.failure:
                return float("nan"), f"run {name!r}: {simulated.failure}"
            errors.append(simulated.response_nrmse)
    return float(np.sqrt(np.mean(np.square(errors)))), ""


def _fitted_model(found: Discovery, ids: tuple[str, ...], fit: Fit) -> JointModel:
    """Return the model of some of the candidates with the coefficients of a fit and given ones."""
    resolved = {term.id: term for term in found.regressor.terms_}
    terms = model_terms(
        [resolved[name] for name in ids], fit.coefficients, fit.covariance, fit.unique_share, fit.effective_degrees,
        found.campaign.joint.motion,
    )  # fmt: skip
    given = tuple(term for term in found.model.terms if term.id in (found.regressor.fixed or {}))
    return replace(found.model, terms=(*terms, *given), covariance=())
