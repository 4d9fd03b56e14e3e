"""Which terms the law of a joint in a structure has: the search, and what further terms, or the paper's, would do."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.terms import Reference, ResolvedTerm, term_columns
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.numeric import Array
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.states import ForceStates, regression_rows
from sindyjoint.substructure.law_errors import LawErrors, Recovered, law_errors, law_excess
from sindyjoint.substructure.unseen import LawRows, Slow, find_slow, with_slow

COLUMNS = ("angle", "rate", "moment")


class Search(NamedTuple):
    """Terms, with the slow angles and whole states that go with them."""

    regressor: TermRegression
    rows: LawRows | None
    states: tuple[ForceStates, ...]
    unseen: Sequence[Array]


def search(
    states: Sequence[ForceStates],
    slow: Sequence[Slow],
    weights: Array,
    options: dict[str, Any],
    before: Search | None,
) -> Search:
    """Choose terms and the slow part of the angles in turn, from what a search before found of these."""
    # Before terms are known the paper's stand for them: one of them bends as the stiffness does.
    allowed = set(PAPER_TERMS)
    unseen: Sequence[Array] = [] if before is None else before.unseen
    whole = tuple(states if before is None else before.states)
    # Each search is made at the slow angles that the terms found before ask for.
    for _ in range(4):
        regressor = TermRegression(**options)
        reference = Reference.of(*(np.concatenate([getattr(s, name) for s in states]) for name in COLUMNS))
        terms = [term for term in regressor.candidates(reference) if term.id in allowed]
        if terms:
            unseen = find_slow(moving_as(states, whole), slow, terms, weights, unseen).unknowns
        unseen = unseen or [each.start for each in slow]
        whole = tuple(map(with_slow, states, slow, unseen))
        arguments = regression_rows(whole, 0.0).fit_arguments()
        regressor.fit(
            **arguments, sample_weight=np.repeat(weights, [np.count_nonzero(s.moving) for s in whole])
        )
        if allowed.issuperset(regressor.selected_):
            break
        allowed = {*PAPER_TERMS, *regressor.selected_}
    found = terms_of(regressor)
    if not found:
        return Search(regressor, None, whole, unseen)
    rows = find_slow(moving_as(states, whole), slow, found, weights, unseen)
    return Search(regressor, rows, tuple(map(with_slow, states, slow, rows.unknowns)), rows.unknowns)


def moving_as(states: Sequence[ForceStates], whole: Sequence[ForceStates]) -> list[ForceStates]:
    """Return states that count as moving where they do with the slow part of their angle."""
    return [replace(s, moving=w.moving) for s, w in zip(states, whole, strict=True)]


def beyond(
    found: Search,
    rows: LawRows,
    states: Sequence[ForceStates],
    recovered: Sequence[Recovered],
    slow: Sequence[Slow],
    dropped: Sequence[ResolvedTerm],
) -> tuple[LawErrors, str]:
    """Return the errors of a law, and which further term stands furthest out of the sensors' noise; "" if none does."""
    law = terms_of(found.regressor)
    rest = [term for term in found.regressor.terms_ if term not in law]
    free = np.arange(len(rest) + len(dropped)) < len(rest)
    rest += dropped
    columns = [
        term_columns(rest, each.states.angle[kept], each.states.rate[kept], each.states.acceleration[kept])
        for each, kept in zip(recovered, rows.kept, strict=True)
    ]
    of_paper = np.array([term.id in PAPER_TERMS for term in rest], dtype=np.bool_)
    errors = law_errors(rows, recovered, slow, columns, of_paper)
    # Rows are no more than they were independent errors: what leaves hardly less of them does not stand out either.
    kept = sum(kept.size for kept in rows.kept)
    gained = np.sqrt(kept * np.maximum(errors.excess / errors.excess_with - 1, 0.0))
    size = np.where(
        free & (errors.excess_with < SUBSTRUCTURE.many_times), np.minimum(np.abs(errors.others), gained), 0.0
    )
    if size.max(initial=0.0) < SUBSTRUCTURE.stands_out:
        return errors, ""
    # The slow angles follow each of them otherwise: those that may stand out as far are fitted, and the paper's. Two
    # numbers in their standard errors differ by one of √2.
    alike = size > size.max() - SUBSTRUCTURE.significant * np.sqrt(2)
    rivals = np.flatnonzero(free & (alike | of_paper))
    left = np.array([_left(found, [*law, rest[place]], states, recovered, slow) for place in rivals])
    # Of terms that these rows do not tell apart the paper's is the simplest.
    simplest = of_paper[rivals] & ((left - left.min()) * kept < SUBSTRUCTURE.stands_out**2)
    return errors, rest[rivals[np.argmin(np.where(simplest, left - left.max(), left))]].id


def _left(
    found: Search,
    law: Sequence[ResolvedTerm],
    states: Sequence[ForceStates],
    recovered: Sequence[Recovered],
    slow: Sequence[Slow],
) -> float:
    """Return what a law leaves of the rows, of what noise makes of it, its slow angles near those that were found."""
    assert found.rows is not None
    moved = moving_as(states, [each.states for each in recovered])
    rows = find_slow(moved, slow, law, found.rows.weights, found.rows.unknowns)
    return law_excess(rows, recovered)


def exchanged(
    found: Search,
    states: Sequence[ForceStates],
    recovered: Sequence[Recovered],
    slow: Sequence[Slow],
    errors: LawErrors,
    forced: Sequence[str],
) -> tuple[ResolvedTerm | None, tuple[str, ...]]:
    """Return a term beyond the paper's, and that of the paper which does as well in its place, if there is any."""
    assert found.rows is not None
    law, kept = terms_of(found.regressor), sum(kept.size for kept in found.rows.kept)
    likely = [term for term in found.regressor.terms_ if term.id in PAPER_TERMS and term not in law]
    for term in law:
        if term.id in PAPER_TERMS or term.id in forced:
            continue
        others = [each for each in law if each is not term]
        left = {each.id: _left(found, [*others, each], states, recovered, slow) for each in likely}
        best = min(left, key=left.__getitem__, default="")
        if best and (left[best] - errors.excess) * kept < SUBSTRUCTURE.stands_out**2:
            return term, (best,)
    return None, ()


def weakest(found: Search, errors: LawErrors, forced: Sequence[str]) -> ResolvedTerm | None:
    """Return the term that stands least out of the noise of the sensors, where its interval holds zero."""
    assert found.rows is not None
    law = terms_of(found.regressor)
    # A term beyond the paper's may stand for one of those that were left out; these stand for themselves.
    known = np.where(
        [term.id in PAPER_TERMS for term in law], *map(np.diag, (errors.of_noise, errors.covariance))
    )
    ratios = np.abs(found.rows.coefficients) / np.sqrt(known)
    place = int(np.argmin(ratios))
    term = law[place]
    return term if ratios[place] < 1.96 and term.id not in forced else None


def terms_of(regressor: TermRegression) -> list[ResolvedTerm]:
    """Return the terms that were found, in the order of the model."""
    resolved = {term.id: term for term in regressor.terms_}
    return [resolved[term.id] for term in regressor.model_.terms]
