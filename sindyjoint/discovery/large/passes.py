"""Passes over rows that are not in memory.

Where nonlinear parameters of a library are shares of the largest angle or rate, a part of the rows gives these first.
Only where the pass then meets values that are larger by more than the policy allows, a second one follows under those.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from sindyjoint.discovery.factors import Factor
from sindyjoint.discovery.policy import POLICY
from sindyjoint.discovery.rows import row_arguments
from sindyjoint.equation.catalogue import Catalogue, Reference, as_catalogue
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.equation.formula import compile_terms
from sindyjoint.inputs import input_names
from sindyjoint.parallel import Executor, ordered_map

if TYPE_CHECKING:
    from sindyjoint.discovery.regression import TermRegression
    from sindyjoint.equation.terms import ResolvedTerm


@dataclass(frozen=True, eq=False)
class Segment:
    """Result of one segment of rows.

    Parameters
    ----------
    factors : tuple of Factor
        One for each of its blocks; none where only the extremes were asked for.
    largest : tuple of float
        Largest angle, rate and moment.
    moving, samples : int
        Rows, and samples of the record they come from.
    failure : str
        Why there is nothing to use in it; empty otherwise.
    """

    factors: tuple[Factor, ...]
    largest: tuple[float, float, float]
    moving: int
    samples: int
    failure: str = ""


class SegmentTask(Protocol):
    """A dataclass that says where a segment of rows is read, and what terms to evaluate on it."""

    @property
    def function(self) -> TermFunction | None:
        """Of the terms; None: only the extremes are needed."""


TaskType = TypeVar("TaskType", bound=SegmentTask)


@dataclass(frozen=True, eq=False)
class Passed:
    """The outcome of the passes.

    Parameters
    ----------
    terms : tuple of ResolvedTerm
    segments : list of Segment
        One per task.
    reference : Reference
        Largest angle, rate and moment of all rows.
    """

    terms: tuple[ResolvedTerm, ...]
    segments: list[Segment]
    reference: Reference


def pass_over(
    regressor: TermRegression,
    work: Callable[[TaskType], Segment],
    tasks: Sequence[TaskType],
    here: Executor,
    *,
    assumed: Reference | None,
    largest: Callable[[Sequence[Segment]], Reference],
    with_acceleration: bool,
    say: Callable[[str], None],
) -> Passed:
    """Evaluate a regressor's candidates on all segments and add them up.

    Parameters
    ----------
    regressor : TermRegression
    work : callable
        Does one task; to be sent to other processes.
    tasks : sequence of SegmentTask
    here : Executor
    assumed : Reference or None
        Scales as far as they are known; ``None``: the library refers to none.
    largest : callable
        Gives the scales of all rows once the segments are known.
    with_acceleration : bool
        Whether the inertia is to be identified as a term.
    say : callable
    """

    def one_pass(scale: Reference) -> tuple[tuple[ResolvedTerm, ...], list[Segment]]:
        terms = regressor.candidates(scale, with_acceleration)
        names = input_names(regressor.inputs)
        arguments = row_arguments((3 if with_acceleration else 2) + len(names), names)
        function = compile_terms([term.expression for term in terms], arguments)
        with_terms: list[Any] = [replace(task, function=function) for task in tasks]  # type: ignore[type-var]
        return terms, ordered_map(
            here, work, with_terms, done=lambda n: say(f"segments: {n} of {len(tasks)}")
        )

    terms, done = one_pass(assumed or Reference(1.0, 1.0, 1.0))
    reference = largest(done)
    if assumed is not None and _exceeds_scale(assumed, reference, as_catalogue(regressor.library)):
        say("larger values than assumed: once more under their scale")
        terms, done = one_pass(reference)
    return Passed(terms, done, reference)


def largest_of(parts: Iterable[Sequence[float]]) -> Reference:
    """Return the largest angle, rate and moment of all parts, each given as three numbers."""
    return Reference(*(max(values) for values in zip(*parts, strict=True)))


def relative(catalogue: Catalogue) -> set[str]:
    """Return the scales of the data that nonlinear parameters of a catalogue are shares of."""
    named = {parameter.relative_to for term in catalogue for parameter in term.parameters}
    return {scale for scale in named if scale is not None}


def _exceeds_scale(scale: Reference, largest: Reference, catalogue: Catalogue) -> bool:
    """Return whether values pass the scale of nonlinear parameters by more than they may."""
    most = 1 + POLICY.scale_excess
    return any(getattr(largest, name) > most * getattr(scale, name) for name in relative(catalogue))
