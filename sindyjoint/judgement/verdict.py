"""Whether a campaign confirms, refutes or leaves open that a joint has the paper's five terms and no others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sindyjoint.described import same
from sindyjoint.discovery import fit_columns
from sindyjoint.discovery.delay import ChannelDelay, columns_of, competing_delay
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.errors import InputError
from sindyjoint.judgement.over_inputs import LevelLaw, law_at_levels, vanishing
from sindyjoint.limits import EQUATION, JUDGEMENT, SUBSTRUCTURE
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.soundness import Finding
from sindyjoint.soundness.warnings import channel_words
from sindyjoint.states import ForceStates
from sindyjoint.text import in_words_of, list_all, spelled


@dataclass(frozen=True)
class Dependence:
    """A term of the paper of which the coefficient depends on an input."""

    term: str
    input: str


@dataclass(frozen=True)
class Verdict:
    """What a campaign says about the paper's term set.

    Parameters
    ----------
    verdict : {"confirmed", "refuted", "undecided"}
    missing, extra : tuple of str
        Ids of the paper's terms that were not found, and of found terms that the paper lacks.
    reason : str
        One sentence.
    dependences : tuple of (str, str)
        Ids of the paper's terms that depend on an input, and that input: at each level they are still the paper's.
    """

    WRITTEN: ClassVar = {**same("verdict", "missing", "extra", "reason"), "dependences": "dependence"}
    verdict: str
    missing: tuple[str, ...]
    extra: tuple[str, ...]
    reason: str
    dependences: tuple[tuple[str, str], ...] = ()

    @property
    def dependence(self) -> tuple[Dependence, ...]:
        """Terms of the paper that depend on an input."""
        return tuple(Dependence(*each) for each in self.dependences)


def unjudged(reason: str) -> Verdict:
    """Return the verdict where no model was looked for."""
    return Verdict("undecided", PAPER_TERMS, (), reason)


def undecided_by_data(verdict: Verdict, findings: Sequence[Finding]) -> Verdict:
    """Return *undecided* in the place of a verdict that the data are not sound enough for.

    Parameters
    ----------
    verdict : Verdict
    findings : sequence of Finding
        Those that stand against it; none: the verdict holds.
    """
    if not findings or verdict.verdict == "undecided":
        return verdict
    faults = ", ".join(dict.fromkeys(f.id.replace("_", " ") for f in findings))
    reason = f"the data are not sound ({faults}: {findings[0].effect})"
    reason += f"; without that: {verdict.verdict}, {verdict.reason}"
    return replace(verdict, verdict="undecided", reason=reason)


def undecided_without_time(verdict: Verdict) -> Verdict:
    """Return the verdict on samples without time: viscous damping, one of the five terms, is not in question there."""
    others = [term for term in PAPER_TERMS if term != "linear_damping"]
    missing = tuple(term for term in others if term in verdict.missing)
    reason = "the samples have no time, so that viscous damping cannot be judged; of the other four terms "
    reason += f"{_spell_terms(missing)} was not found" if missing else "all were found"
    reason += (
        f", and beyond them {_spell_terms(verdict.extra)}" if verdict.extra else ", and nothing beyond them"
    )
    return replace(verdict, verdict="undecided", missing=missing, reason=reason)


def judge(
    regressor: TermRegression,
    model: JointModel,
    unresolved: ChannelDelay | None = None,
) -> Verdict:
    """Say whether the campaign confirms the paper's five terms.

    The misfit comes before the terms: where more of the moment is neither model nor noise than the weakest term
    carries, or where a delay is left in the channels, the terms found may stand for what is not understood.

    Parameters
    ----------
    regressor : TermRegression
        Fitted; holds the candidates and their evidence.
    model : JointModel
        What it found, with the noise floor of the campaign.
    unresolved : ChannelDelay, optional
        Delay between the channels that was found and not removed.
    """
    law = law_at_levels(model)
    missing = tuple(term for term in PAPER_TERMS if term not in law.ids)
    extra = tuple(term for term in law.ids if term not in PAPER_TERMS)
    verdict, reason = _reach_verdict(regressor, model, missing, extra)
    if law.dependences:
        verdict, reason = _at_each_level(verdict, reason, model, law)
    if verdict != "undecided" and unresolved is not None:
        verdict, reason = "undecided", _spell_delay(unresolved)
    return Verdict(verdict, missing, extra, in_words_of(model.joint.motion, reason), law.dependences)


def _at_each_level(verdict: str, reason: str, model: JointModel, law: LevelLaw) -> tuple[str, str]:
    """Return verdict and reason of a law of which coefficients depend on inputs."""
    gone = vanishing(model, law)
    if verdict == "confirmed" and gone:
        term, name = gone[0]
        return "undecided", (
            f"{spelled(term)} changes its sign over the tested range of {name}, so that it vanishes at a level between "
            f"({law.words(model)})"
        )
    if verdict == "confirmed":
        reason = f"at each level {reason}"
    return verdict, f"{reason}; {law.words(model)}"


def _spell_delay(delay: ChannelDelay) -> str:
    """Return why a delay between the channels leaves the terms open."""
    if delay.at_limit:
        return (
            f"the delay between the channels is beyond the {1e3 * abs(delay.time):.0f} ms that are searched, or the "
            "law lacks a term: check the trigger of the recorder"
        )
    return (
        f"a delay between the channels of {1e3 * abs(delay.time):.3f} ± {1e3 * delay.standard_error:.3f} ms is not "
        "resolved, and other terms may stand for it: run again with --align, or check the trigger of the recorder"
    )


def _reach_verdict(
    regressor: TermRegression, model: JointModel, missing: tuple[str, ...], extra: tuple[str, ...]
) -> tuple[str, str]:
    """Return the verdict and its reason."""
    word, _ = channel_words(model)
    if len(missing) == len(PAPER_TERMS) and not extra:
        return "undecided", f"no model was found: {regressor.selection_result_.reason}"
    offered = {*regressor.evidence_.ids, *regressor.indistinct_}
    withheld = [term for term in PAPER_TERMS if term not in offered]
    if withheld:
        return "undecided", f"{_spell_terms(withheld)} was not among the candidates: others may replace it"
    gap = model.fitted.misfit
    # What a coefficient's dependence carries is no term of its own at any level.
    plain = [term for term in model.terms if term.id != INERTIA and not term.inputs]
    least = min(term.unique_share for term in plain or model.terms)
    if gap > _tolerated(model, least):
        # What is not understood is larger than the weakest term found: it may be a term, or stand behind one.
        those = "five terms" if not (missing or extra) else "terms found"
        if not np.isfinite(model.fitted.noise_floor):
            return "undecided", (
                f"no noise floor could be measured: the {those} leave {100 * gap:.1f} % of the {word}, and how much of "
                f"that is noise is unknown; their smallest unique share is {100 * least:.1f} %; record runs that "
                "repeat, or declare noise in [channels]"
            )
        return "undecided", (
            f"the {those} are the best of these candidates, yet leave {100 * gap:.1f} % of the {word} beyond the "
            f"noise; their smallest unique share is {100 * least:.1f} %"
        )
    if model.fitted.runs == 1 and model.fitted.frequencies:
        # On one closed curve every term is a function of the phase: sums of other terms come arbitrarily close.
        reason = "one periodic run cannot distinguish terms: add levels and frequencies"
        return "undecided", f"{reason} (found: {_spell_terms(model.ids)})"
    if extra == ("constant_moment",) and not set(missing) - {"quadratic_stiffness"}:
        reason = "in addition to the paper's terms the data need a constant, which may be a zero error of a sensor, "
        reason += "preload or friction that differs by direction"
        return "undecided", reason + (", and which can hide quadratic stiffness" if missing else "")
    if extra and missing and not _is_needed(regressor, extra):
        reason = f"{_spell_terms(extra)} may replace {_spell_terms(missing)}: together with the paper's five terms "
        return "undecided", reason + "they are not significant on these runs"
    if extra:
        reason = f"the data need {_spell_terms(extra)}, which the paper's law lacks"
        return "refuted", reason + (f", and do not show {_spell_terms(missing)}" if missing else "")
    hidden = [term for term in missing if _find_largest_share(regressor, model, term) > JUDGEMENT.small_share]
    absent = [term for term in missing if term not in hidden]
    if absent and _is_needed(regressor, absent):
        return (
            "undecided",
            f"{_spell_terms(absent)} is significant beside the other terms, yet too small to be chosen: it carries "
            f"less than {100 * JUDGEMENT.small_share:.0f} % of the {word}; record higher levels",
        )
    if absent:
        return (
            "refuted",
            f"{_spell_terms(absent)} would carry less than {100 * JUDGEMENT.small_share:.0f} % of the {word}",
        )
    if hidden:
        return "undecided", f"{_spell_terms(hidden)} was not found, and these runs could not have shown it"
    return "confirmed", (
        f"exactly the paper's five terms out of {len(regressor.terms_)} candidates; their smallest unique share "
        f"is {100 * least:.1f} % of the {word}, and the misfit beyond the noise {100 * gap:.1f} %"
    )


def _tolerated(model: JointModel, least: float) -> float:
    """Return the misfit up to which terms are judged, of which the weakest has the unique share ``least``."""
    floor = np.nan_to_num(model.fitted.noise_floor)
    uncertainty = float(JUDGEMENT.unknown * floor / model.fitted.moment_rms)
    return min(max(least, uncertainty), EQUATION.tolerated)


def _is_needed(regressor: TermRegression, extra: Sequence[str]) -> bool:
    """Return whether any of the given terms is significant when all of the paper's terms are in the law with them."""
    ids = regressor.evidence_.ids
    columns = [ids.index(term) for term in dict.fromkeys((*extra, *PAPER_TERMS)) if term in ids]
    fit = fit_columns(regressor.evidence_, columns)
    others = [i for i, column in enumerate(columns) if ids[column] in extra]
    return bool(np.any(fit.t_ratios[others] >= regressor.significance))


def leaves_noise(model: JointModel) -> bool:
    """Return whether the residual of a model is that of the noise, within the uncertainty of this."""
    return bool(model.terms) and _alike(model.fitted.residual_rms, model.fitted.noise_floor)


def _alike(residual: float, noise: float) -> bool:
    """Return whether a residual is that of the noise, within the uncertainty of this."""
    return bool(residual**2 < (1 + JUDGEMENT.unknown**2) * noise**2)


def _spell_terms(terms: Sequence[str]) -> str:
    return list_all([*map(spelled, terms)])


def _find_largest_share(regressor: TermRegression, model: JointModel, term: str) -> float:
    """Return the share of the moment that a term may carry at the end of its 95 % interval.

    It joins the found terms; a term that these runs cannot distinguish from the found ones may carry anything.
    """
    ids = regressor.evidence_.ids
    if term not in ids:
        return float("inf")
    columns = [ids.index(found) for found in model.ids if found in ids]
    fit = fit_columns(regressor.evidence_, [*columns, ids.index(term)])
    size, error, share = abs(fit.coefficients[-1]), fit.standard_errors[-1], fit.unique_share[-1]
    return float(share * (size + 2 * error) / size) if size > 0 else float("inf")


def unresolved_delay(
    delay: ChannelDelay | None, regressor: TermRegression, model: JointModel, states: Sequence[ForceStates]
) -> ChannelDelay | None:
    """Return the delay that is left in the channels, or that explains the moment as well as terms beyond the paper's.

    A law that lacks a term takes a delay for it, and a delay is taken for terms: the one that leaves less is believed.
    States as measured, which lack weak harmonics, show one too, that is not there once they are completed.
    """
    if delay is None or not model.terms:
        return None
    extra = [term for term in model.ids if term not in (*PAPER_TERMS, INERTIA)]
    if not extra and not any(state.completed for state in states):
        return delay if delay.significant else None
    least = max(float(np.nan_to_num(model.fitted.noise_floor)), model.fitted.residual_rms)
    if extra and delay.significant and not delay.at_limit and _alike(delay.residual_rms, least):
        return delay
    chosen = [term for term in regressor.terms_ if term.id in model]
    try:
        found = competing_delay(states, columns_of(chosen), model.joint.inertia)
    except (np.linalg.LinAlgError, InputError):
        return None
    return found if found.significant else None


def of_one_run(verdict: Verdict, runs: int) -> Verdict:
    """Return a verdict that refutes nothing by one run: what the recovery does to it, no other run tells."""
    if runs > 1 or verdict.verdict != "refuted":
        return verdict
    reason = f"one run of a structure cannot refute a term; record runs at other levels: {verdict.reason}"
    return replace(verdict, verdict="undecided", reason=reason)


def few_rows(rows: int, unknowns: int) -> str:
    """Say that a joint moves too little for what is found with its law; empty where it does not.

    Parameters
    ----------
    rows : int
        Samples in which the joint moves.
    unknowns : int
        Numbers of the slow part of its angle, which no sensor shows.
    """
    if rows >= SUBSTRUCTURE.rows_per_unknown * unknowns:
        return ""
    return (
        f"the joint moves in only {rows} samples, from which {unknowns} numbers of its slow angle are found along with "
        "the law: coefficients may be off by more than their intervals, quadratic stiffness by its whole size; use "
        "--refine, or record sweeps or sines, which move the joint longer"
    )


def of_many_rows(verdict: Verdict, rows: int, unknowns: int) -> Verdict:
    """Return a verdict that refutes nothing by rows of a joint that are few beside what is found with its law."""
    few = few_rows(rows, unknowns)
    if not few or verdict.verdict != "refuted":
        return verdict
    return replace(verdict, verdict="undecided", reason=f"{few}; without that: {verdict.reason}")


def of_slight_terms(verdict: Verdict, model: JointModel) -> Verdict:
    """Return a verdict that refutes nothing by terms that carry less of the moment than a structure is known to.

    Parameters
    ----------
    verdict : Verdict
    model : JointModel
        What was found, with the unique shares of its terms.
    """
    shares = {term.id: term.unique_share for term in model.terms}
    extra = [shares.get(term, float("inf")) for term in verdict.extra]
    if (
        verdict.verdict != "refuted"
        or verdict.missing
        or not max(extra, default=0.0) < SUBSTRUCTURE.refuting_share
    ):
        return verdict
    words = " and ".join(map(spelled, verdict.extra))
    reason = (
        f"beyond the five terms the data need {words}, which carry less than {100 * SUBSTRUCTURE.refuting_share:g} % "
        "of the moment: errors in the description of the structure may be as large"
    )
    return replace(verdict, verdict="undecided", reason=reason)


def within_the_states(verdict: Verdict, share: float, hidden: float) -> Verdict:
    """Return a verdict that is no surer than the states.

    An error of the angle is one of the elastic moment of the same share: beyond the share below which a term counts as
    absent, absence does not follow from what fits best. Presence does, as long as no other term could carry as much
    beside the law unseen.

    Parameters
    ----------
    verdict : Verdict
    share : float
        RMS error of the angle, of itself.
    hidden : float
        Largest share of the moment that a standard error of a term that is not in the law is.
    """
    unknown = JUDGEMENT.likely * hidden if verdict.verdict == "confirmed" else share
    if unknown <= JUDGEMENT.small_share or verdict.verdict == "undecided":
        return verdict
    what = (
        f"a term that carries up to {100 * unknown:.1f} % of the moment could be hidden from the sensors"
        if verdict.verdict == "confirmed"
        else f"the sensors determine the angle of the joint only to {100 * unknown:.1f} %"
    )
    reason = (
        f"{what}, and terms are judged down to {100 * JUDGEMENT.small_share:.0f} % of the moment: add sensors of "
        f"displacement, longer runs or sines; without that: {verdict.verdict}, {verdict.reason}"
    )
    return replace(verdict, verdict="undecided", reason=reason)
