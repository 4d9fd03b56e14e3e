"""What a verdict on the law of a joint inside a structure may not say: more than its sensors show."""

from __future__ import annotations

from dataclasses import replace

from sindyjoint.equation.model import JointModel
from sindyjoint.judgement.policy import POLICY
from sindyjoint.judgement.verdict import Verdict
from sindyjoint.substructure.policy import POLICY as LIMITS
from sindyjoint.text import spelled

SURE = 2.0  # standard errors of a term within which it may be there unseen


def of_one_run(verdict: Verdict, runs: int) -> Verdict:
    """Return a verdict that refutes nothing by one run: what the recovery does to it, no other run tells."""
    if runs > 1 or verdict.verdict != "refuted":
        return verdict
    reason = f"one run of the structure refutes no term; others at other levels would tell: {verdict.reason}"
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
    if rows >= LIMITS.rows_per_unknown * unknowns:
        return ""
    return (
        f"the joint moves in {rows} samples only, and {unknowns} numbers of its slow angle are found with the law: "
        "by regression coefficients may be further off than their intervals say, quadratic stiffness by all of itself; "
        "refine on the simulated response, or make sweeps or sines, which move it longer"
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
    if verdict.verdict != "refuted" or verdict.missing or not max(extra, default=0.0) < LIMITS.refuting_share:
        return verdict
    words = " and ".join(map(spelled, verdict.extra))
    reason = (
        f"the data need {words}, which carry less than {100 * LIMITS.refuting_share:g} % of the moment: a structure is "
        "hardly described more accurately; the five terms carry the rest"
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
    unknown = SURE * hidden if verdict.verdict == "confirmed" else share
    if unknown <= POLICY.negligible_share or verdict.verdict == "undecided":
        return verdict
    what = (
        f"the sensors leave room for {100 * unknown:.1f} % of the moment beside the law"
        if verdict.verdict == "confirmed"
        else f"the sensors show the angle of the joint only within {100 * unknown:.1f} % of itself"
    )
    reason = (
        f"{what}, and terms are judged down to {100 * POLICY.negligible_share:.0f} % of the moment: sensors of "
        f"displacement, longer runs or sines would tell; without that: {verdict.verdict}, {verdict.reason}"
    )
    return replace(verdict, verdict="undecided", reason=reason)
