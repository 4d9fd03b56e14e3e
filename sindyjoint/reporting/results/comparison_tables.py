"""The tables of a comparison: what every choice leads to, its terms, its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.discovery.policy import POLICY as DISCOVERY
from sindyjoint.judgement.comparison import Choice, ChosenTerm, Comparison, GivenModel
from sindyjoint.reporting.equation import interval_text, superscripted
from sindyjoint.reporting.style import pretty_unit, shortened
from sindyjoint.reporting.tables import (
    DASH,
    TextTable,
    tabulate,
)
from sindyjoint.text import list_some, quantities, rounded, spelled


def _best_first(choices: Sequence[Choice]) -> list[Choice]:
    """Return choices by what they err on what was left out, then on the response, then on what was fitted.

    Those that are equal as far as is shown keep their order.
    """
    worst = float("inf")

    def errors(choice: Choice) -> list[float]:
        known = (choice.held_out, choice.response, choice.residual)
        return [round(value, 4) if choice.terms and np.isfinite(value) else worst for value in known]

    return sorted(choices, key=errors)


def _named(result: Comparison, term: str) -> str:
    return f"{spelled(term, result.motion)} ({pretty_unit(result.units.get(term, '?'))})"


def against_terms_table(by: str, result: Comparison, choices: Sequence[Choice]) -> TextTable:
    """Return a row for each term, and for what a search was not given; a column for each choice, best first."""
    whole = {
        "method": ("methods", "Methods against terms"),
        "library": ("libraries", "Libraries against terms"),
    }
    several = {"frequency": "frequencies"}.get(by, f"{by}s")
    name, title = whole.get(by, (several, f"Each single {by} against terms"))
    choices = _best_first(choices)
    held = [t for t in result.shown_ids if t in result.reference or any(choice[t] for choice in choices)]
    rows = [(_named(result, term), *(_cell(choice, term) for choice in choices)) for term in held]
    more = {
        "time of the path, s": [f"{c.seconds:.2f}" if np.isfinite(c.seconds) else DASH for c in choices],
        "its search is not given": [", ".join(choice.not_given) or DASH for choice in choices],
    }
    rows += [(called, *cells) for called, cells in more.items() if set(cells) != {DASH}]
    return TextTable(name, title, ("term", *(choice.name for choice in choices)), tuple(rows))


def coefficients_table(result: Comparison) -> TextTable:
    """List each term of the model: inclusion, value and interval."""
    share = dict(zip(result.ids, result.inclusion, strict=True))

    columns: dict[str, Callable[[ChosenTerm], str]] = {
        "term": lambda term: _named(result, term.id),
        "in resampled campaigns": lambda term: _percent(share.get(term.id, float("nan"))),
        "value": lambda term: _value(term.coefficient, term.standard_error),
        "95 % interval": lambda term: interval_text(*term.interval95, term.standard_error),
    }
    return tabulate("coefficients", "Coefficients", result.model.terms, columns)


def tests_table(tests: Sequence[FrequencyTest], motion: str) -> TextTable:
    """Return a row for each coefficient: its value at each frequency, and whether that changes."""

    def estimate(test: FrequencyTest, at: int) -> str:
        return _value(test.estimates[at], test.standard_errors[at])

    def answer(test: FrequencyTest) -> str:
        small = test.answer == "independent within margin" and test.p_value < DISCOVERY.frequency_level
        return test.answer + (f"; a change of {_trend(test)} is significant" if small else "")

    columns: dict[str, Callable[[FrequencyTest], str]] = {
        "term": lambda test: spelled(test.name, motion),
        **{f"{f:.4g} Hz": partial(estimate, at=at) for at, f in enumerate(tests[0].frequencies)},
        "Q": lambda test: f"{test.q:.1f}",
        "I²": lambda test: f"{100 * test.i_squared:.0f} %",
        "τ / mean": lambda test: _percent(test.tau / abs(test.mean)),
        "trend over band": _trend,
        "p": lambda test: f"{test.p_value:.2g}",
        "at most": lambda test: _percent(test.change_bound),
        "answer": answer,
    }
    return tabulate(
        "frequency-dependence", "Are the coefficients the same at every frequency?", tests, columns
    )


def _trend(test: FrequencyTest) -> str:
    """Return the change over the tested band, of the mean."""
    return f"{100 * test.change:+.1f} %".replace("-", "−")


def folds_table(result: Comparison) -> TextTable:
    """Return what is found without each frequency, level or part, and its error there."""
    rows = [
        (
            f"{kind}: {', '.join(fold.left_out)}",
            _percent(fold.moment_error),
            "the same"
            if fold.kept == result.model.ids
            else ", ".join(spelled(term, result.motion) for term in fold.kept) or "none",
        )
        for kind, validation in result.left_out.items()
        for fold in validation.folds
    ]
    single = set(result.left_out) == {"time"}
    kinds = " or ".join(
        kind if kind in ("frequency", "level") else f"level of {kind}" for kind in result.left_out
    )
    apart = (
        "one run"
        if set(result.left_out) == {"run"}
        else f"the runs of one {kinds}".replace("level of run", "run")
    )
    return TextTable(
        "left-out",
        "Without one part of the run" if single else f"Without {apart}",
        ("left out", f"error of its {quantities(result.motion).moment.lower()}", "terms found"),
        tuple(rows),
    )


def choices_table(result: Comparison) -> TextTable:
    """Return what every choice leads to, by method, frequency, level and library, best first; and the floor."""
    own = "the paper's" if result.of_paper else "the model's"
    load, given = quantities(result.motion).moment.lower(), result.given
    rows: list[tuple[str, ...]] = [
        (
            shortened(choice.name),
            by,
            str(len(choice.terms)),
            _percent(choice.held_out, choice.held_out_error),
            _percent(choice.response),
            _percent(choice.residual),
            _difference(result, choice),
        )
        for by, choices in result.groups.items()
        for choice in _best_first(choices)
    ]
    if given is not None:
        held = (
            DASH if given.seen else _percent(given.residual),
            _percent(given.response),
            _percent(given.residual),
        )
        rows.append(("given model", "", str(len(given.terms)), *held, _listed(given.elements, result.motion)))
    floor = _percent(result.noise_floor) if np.isfinite(result.noise_floor) else "unknown"
    rows.append(("noise floor", *[""] * 4, floor, ""))
    columns = ("Choice", "By", "Terms", f"Left-out {load}", "Response", "Residual", f"Instead of {own}")
    return TextTable("choices", "Choices, best first", columns, tuple(rows), text=("Choice",))


def given_model_table(given: GivenModel, motion: str) -> TextTable:
    """Return a model that was there before, beside the others."""
    rows = (
        ("terms", _listed(given.terms, motion)),
        ("elements", _listed(given.elements, motion)),
        ("its numbers were fitted to this campaign", "yes" if given.seen else "no"),
    )
    return TextTable("given-model", "The given model", ("", "given model"), rows)


def _listed(ids: Sequence[str], motion: str) -> str:
    return ", ".join(spelled(name, motion) for name in ids) or DASH


def _difference(result: Comparison, choice: Choice) -> str:
    """Return what a choice has instead of the terms that it is held against."""
    if not choice.terms:
        return "no model"
    extra, missing = choice.beside(result.reference)
    signed = (("+", extra), ("−", missing))
    parts = [f"{sign} {spelled(term, result.motion)}" for sign, terms in signed for term in terms]
    return list_some(parts, "terms") if parts else "the same"


def _cell(choice: Choice, term: str) -> str:
    held = choice[term]
    return DASH if held is None else _value(held.coefficient, held.standard_error)


def _value(value: float, error: float) -> str:
    return superscripted(rounded(value, error)) if np.isfinite(error) else f"{value:.4g}".replace("-", "−")


def _percent(value: float, error: float = float("nan")) -> str:
    if np.isfinite(value) and np.isfinite(error) and error > 0:
        return f"{rounded(100 * value, 100 * error)} %"
    return f"{100 * value:.{2 if value < 0.1 else 0}f} %" if np.isfinite(value) else DASH


def seconds(value: float) -> str:
    """Return a time in s; a dash where there is none."""
    return f"{value:.2f} s" if np.isfinite(value) else DASH
