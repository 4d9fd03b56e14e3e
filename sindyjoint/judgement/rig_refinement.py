"""Laws found inside a structure, fitted again to what its sensors showed, its own numbers as nuisances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sindyjoint.described import Maybe, same
from sindyjoint.diagnosis.structure.output_error import Fit, fit
from sindyjoint.diagnosis.structure.records import runs_problem
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.substructure.recovery import Recovery, Update

# Fits to the response, residuals whitened anew before each.
ROUNDS = 2
ITERATIONS = 8
# Further starts are so many standard errors away from what the regression found.
SPREAD = 4.0
# Two ends whose χ² differs by less than this are one.
SAME_END = 1.0
# Times the noise beyond which the response is not explained.
DISAGREES = 1.5


@dataclass(frozen=True, eq=False)
class RigRefinement:
    """The result of :func:`refine_rig`.

    Parameters
    ----------
    refined : bool
    reason : str
        Why it did not succeed; empty where it did.
    models : dict of str to JointModel
        By kind of joint, with covariance; those given where it did not succeed.
    update : Update or None
        Of the structure's uncertain numbers.
    before, after : float
        Root mean square of simulated less measured in their noise, with the laws as given and as refined.
    ends : tuple of float
        χ² at which the search ended from each start, the given laws first; NaN where it failed.
    """

    WRITTEN: ClassVar = same("refined", "reason", "before", "after", "ends")
    refined: bool
    reason: str
    models: dict[str, JointModel]
    update: Update | None
    before: Maybe
    after: Maybe
    ends: tuple[Maybe, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know of it, in words."""
        if not self.refined:
            return (f"not refined on the simulated response: {self.reason}",)
        other = sum(not end < min(self.ends) + SAME_END for end in self.ends)
        found = f"{len(self.ends)} starts end alike"
        if other:
            found = f"{other} of {len(self.ends)} starts end worse, or cannot be simulated"
        words: tuple[str, ...] = (
            f"refined on the simulated response: {self.before:.2f} times the noise before, {self.after:.2f} after; "
            f"{found}",
        )
        if self.after > DISAGREES:
            words += (
                f"the simulated response is {self.after:.1f} times the noise off: laws or structure lack something; "
                "diagnose the rig",
            )
        return words


def refine_rig(
    test: RigTest,
    recoveries: Sequence[Recovery],
    models: dict[str, JointModel],
    *,
    starts: int = 3,
    random_state: int | np.random.Generator | None = 0,
    progress: Callable[[str], None] | None = None,
) -> RigRefinement:
    """Fit the numbers of models in the joints of a structure to what its sensors showed.

    Simulated is the whole structure under the measured drive: its steady motion where the drive repeats, else its
    motion in segments. The structure's uncertain numbers are fitted too, under the priors that its file states, which
    runs at a level at which the joints stick narrow before.

    Parameters
    ----------
    test : RigTest
        The structure as it is described.
    recoveries : sequence of Recovery
        Of the runs that are fitted.
    models : dict of str to JointModel
        By kind of joint.
    starts : int
        How many starts, the given laws among them.
    random_state : int, Generator or None
        Of the further starts.
    progress : callable, optional

    Returns
    -------
    RigRefinement
    """
    say = progress or (lambda stage: None)
    nothing = float("nan")
    try:
        problem = runs_problem(test, recoveries, models)
    except InputError as error:
        return RigRefinement(False, str(error), models, None, nothing, nothing)
    start = problem.start()
    first = problem.residuals(start)
    assert first is not None
    generator = np.random.default_rng(random_state)
    found: list[Fit | None] = []
    for number in range(starts):
        say(f"refining on the simulated response, start {number + 1} of {starts}")
        shift = generator.normal(size=start.size) * (SPREAD if number else 0.0)
        shift[: problem.numbers] /= SPREAD
        found.append(fit(problem, shift, problem.duration, iterations=ITERATIONS))
    best = min((each for each in found if each is not None), key=lambda each: each.cost, default=None)
    if best is None:
        return RigRefinement(False, "no start could be simulated", models, None, nothing, nothing)
    for _ in range(ROUNDS - 1):
        problem = problem.whitened(best.x)
        again = fit(problem, best.x, problem.duration, iterations=ITERATIONS)
        best = best if again is None else again
    covariance = problem.covariance(best.x)
    degrees = max(problem.rows() - best.x.size, 1.0)
    last = problem.residuals(best.x)
    assert last is not None
    return RigRefinement(
        True, "", problem.models(best.x, covariance), problem.update(best.x, covariance),
        float(np.sqrt(first @ first / degrees)), float(np.sqrt(last @ last / degrees)),
        tuple(nothing if each is None else each.cost for each in found),
    )  # fmt: skip
