"""What a diagnosis asks of its data: of a campaign of runs, or of the pulse record of a structure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, Self, TypeVar

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.evidence.score import Candidate, Ranking
from sindyjoint.diagnosis.parts import Budget, Place
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Advice, Diagnosis, Gap, Step
from sindyjoint.diagnosis.verdict import Residual

Say = Callable[[str], None]


P = TypeVar("P", bound="Problem")


@dataclass(frozen=True)
class Start(Generic[P]):
    """Where a search begins.

    Parameters
    ----------
    problem : Problem
    steps : tuple of Step
        What it has found before.
    words : str
        How it differs from the model as it was given.
    before : Problem, optional
        The problem without those steps.
    """

    problem: P
    steps: tuple[Step, ...] = ()
    words: str = ""
    before: P | None = None

    @property
    def free(self) -> int:
        """Number of its steps: they do not count among the effects that may be added."""
        return len(self.steps)


class Problem(Protocol):
    """A gap to explain, and the effects added to the model so far. Immutable: adding one gives another problem."""

    @property
    def policy(self) -> DiagnosisPolicy:
        """Its limits."""

    @property
    def found(self) -> Sequence[Candidate]:
        """The effects added, with the numbers of the last fit."""

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Numbers of the effects added, by the effects' names."""
        return {each.name: dict(each.parameters) for each in self.found}

    @property
    def dropped(self) -> tuple[str, ...]:
        """Terms of the model that the last effect made needless."""
        return ()

    @property
    def is_noise(self) -> bool:
        """Whether it is sure, without a further search, that nothing but noise remains."""
        return False

    @property
    def numbers(self) -> int:
        """Numbers of the law: coefficients of the model and the effects, and nonlinear parameters."""
        return 0

    @property
    def gap(self) -> Gap:
        """On data left out of the fit, with the effects."""

    @property
    def initial_gap(self) -> Gap:
        """On data left out of the fit, of the model as it was given."""
        return self.gap

    @property
    def noise_floor(self) -> Gap:
        """What does not repeat."""

    @property
    def floor_is_bound(self) -> bool:
        """Whether that is only an upper bound."""
        return False

    def gap_without(self, names: Collection[str]) -> Gap:
        """Return the gap without some of the effects, the others fitted anew."""
        return self.gap

    def uncertainty(self) -> Gap:
        """Return the gap of the response that noise alone leaves, beside the floor, by numbers and drive."""
        return Gap(0.0, 0.0)

    def corrected(self) -> tuple[Self, tuple[Step, ...]]:
        """Return the problem with channels put right that drift for all to see, and the steps that this took."""
        return self, ()

    def searched(self, begun: Any, most: int, say: Say, search: Portion) -> Any:
        """Return the progress with the effects that the data show, at most so many, as far as the portion goes."""

    def cost(self) -> float:
        """Return what the set of effects found costs, the less the better the data are predicted."""
        return 0.0

    def propose(self, refused: Collection[str], say: Say) -> Ranking[Any] | None:
        """Return the candidates in order of probability; None where there are none."""
        return None

    def add(self, best: Any) -> Self | None:
        """Return the problem with an effect more, less those that it makes needless; None where the fit fails."""
        return None

    def units(self, fitted: Any) -> dict[str, str]:
        """Return the units of an effect's parameters."""

    def finished(self) -> Self:
        """Return the problem after a last refinement of its numbers."""
        return self

    def other_starts(self, straight: Self, last: Self, say: Say) -> Iterator[Start[Self]]:
        """Yield other starts worth a search, where that from the model as it was given left a remainder in ``last``."""
        return iter(())

    def zero_start(self, straight: Self, last: Self, say: Say) -> Start[Self] | None:
        """Return the start with displacements counted from the joint's own zero; None where no zero error was found."""
        return None

    def residual(self, straight: Self) -> Residual:
        """Return what the effects leave of the gap that channels put right had."""

    def budget(self, first: Self, last: Self) -> Budget:
        """Return the parts of the first problem's gap; this one is it with its channels put right."""

    def places(self) -> tuple[Place, ...]:
        """Return where the gap of the model as it was given lies."""

    def separating_runs(
        self, step: Step, ranking: Ranking[Any], search: Portion, say: Say
    ) -> tuple[tuple[Advice, ...], int, int]:
        """Return the runs that would tell the members of a class apart, how many were tried, and of how many."""
        return (), 0, 0

    def diagnosis(self, first: Self, found: Mapping[str, Any]) -> Diagnosis:
        """Return the result: what was found, completed by model, effects, pictures and warnings."""
