"""The pulse record of a structure as a problem: a model in its joint, its coefficients and the effects so far."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.evidence import Ranking, rise
from sindyjoint.diagnosis.parts import Budget, Place, divide_gap, most_informative
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.problem import Problem, Say
from sindyjoint.diagnosis.result import Advice, Diagnosis, Gap, RecordGap, Step
from sindyjoint.diagnosis.structure import Fit, FittedChange, covariance_of, fit, score_of
from sindyjoint.diagnosis.structure.gap import locate_gap, record_gaps
from sindyjoint.diagnosis.structure.kinds import assemble_model, with_slopes
from sindyjoint.diagnosis.structure.pulses import PulseProblem, separating_pulses
from sindyjoint.diagnosis.structure.search import rank_changes, search
from sindyjoint.diagnosis.structure.start import (
    first_fit,
    hidden_pulse_test,
    model_in_place,
    open_rig,
    other_pulse,
    pulse_problem,
)
from sindyjoint.diagnosis.verdict import Residual, share_beyond_noise
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.mechanics.rigs import Rig
from sindyjoint.numeric import RNG, Array


@dataclass(frozen=True, eq=False)
class StructureProblem(Problem):
    """A pulse test, and the model of its joint with the effects added so far.

    Parameters
    ----------
    pulse : PulseProblem
        With the effects.
    best : Fit
        Of all its numbers over the whole record.
    changes : tuple of Change
        The candidates.
    period : float
        Of the main oscillation, s.
    others : tuple of PulseProblem
        Other pulses, which no fit sees.
    named : tuple of FittedChange
        The effects as they were found.
    drops : tuple of (str, float)
        Part of the budget of each effect ever added, and the fall of χ² that it brought.
    hidden : str, optional
        What a virtual test had hidden.
    drawn : bool
        Whether the model is the rig's own law.
    beyond : tuple of str
        Where joints move beyond what the model that was given was tested to.
    """

    pulse: PulseProblem
    best: Fit
    changes: tuple[Change, ...]
    period: float
    others: tuple[PulseProblem, ...] = ()
    named: tuple[FittedChange, ...] = ()
    drops: tuple[tuple[str, float], ...] = ()
    hidden: str | None = None
    drawn: bool = False
    beyond: tuple[str, ...] = ()

    @classmethod
    def build(
        cls,
        rig: Rig | str | Path,
        model: JointModel | None,
        effects: Sequence[Effect],
        hold_out: Sequence[Rig | str | Path],
        random_state: RNG,
        policy: DiagnosisPolicy,
        say: Say,
    ) -> "StructureProblem":
        """Return the problem of a rig; one that names no records is tested virtually, with something hidden in it."""
        rig, kept_out = open_rig(rig), [open_rig(each) for each in hold_out]
        model, places, drawn = model_in_place(rig, model, policy)
        hidden = None
        if rig.measured is None:
            if kept_out:
                raise InputError(f"hold_out is given, but the rig {rig.name!r} names no measured response")
            say("simulating a virtual pulse test with something hidden in it")
            generator = np.random.default_rng(random_state or 0)
            rig, hidden = hidden_pulse_test(rig, places, model, generator, drawn)
        say("the response of the model")
        pulse, changes, period, beyond = pulse_problem(rig, model, places, effects, policy)
        others = tuple(other_pulse(pulse, each) for each in kept_out)
        fitted = first_fit(pulse)
        return cls(pulse, fitted, changes, period, others, hidden=hidden, drawn=drawn, beyond=beyond)

    @property
    def policy(self) -> DiagnosisPolicy:
        """Its limits."""
        return self.pulse.policy

    @property
    def found(self) -> tuple[FittedChange, ...]:
        """The effects added, with the numbers of the last fit."""
        ends = np.cumsum([self.pulse.priors, *(change.size for change in self.pulse.found)])
        own = {c: self.best.x[end - c.size : end] for c, end in zip(self.pulse.found, ends[1:], strict=True)}
        return tuple(replace(each, x=own[each.change]) for each in self.named)

    @property
    def is_noise(self) -> bool:
        """Whether the residual is noise, as surely as the noise itself is known."""
        rows = self.pulse.rows()
        # Variance of a mean square in units of noise, times the samples: 2 of its own, the rest of the noise's.
        variance = 2 + 2 / self.policy.late_share
        sure = self.policy.significant * float(np.sqrt(variance / rows))
        return self.best.cost / rows < 1 + sure

    @cached_property
    def records(self) -> tuple[RecordGap, ...]:
        """What was held out, beside the simulations."""
        return record_gaps(self.pulse, self.best, self.others)

    @property
    def initial_gap(self) -> Gap:
        """Relative RMS of the response on what was held out, of the model as it was given."""
        return self.pooled("gap_before")

    @property
    def gap(self) -> Gap:
        """The same, of the model fitted to what was not held out; no moment is measured in a structure."""
        return self.pooled("gap_after")

    @property
    def noise_floor(self) -> Gap:
        """Noise of the records relative to their RMS over what was held out."""
        return self.pooled("noise_floor")

    def pooled(self, name: str) -> Gap:
        """Return the RMS of a figure over all records."""
        figures = [getattr(record, name) for record in self.records]
        return Gap(float("nan"), float(np.sqrt(np.mean(np.square(figures)))))

    def propose(self, refused: Collection[str], say: Say) -> Ranking[FittedChange] | None:
        """Return the candidates in order of probability."""
        taken = {*refused, *(each.name for each in self.named)}
        candidates = [change for change in self.changes if change.effect.id not in taken]
        fitted = search(self.pulse, self.best, candidates, self.period, say)
        return rank_changes(self.pulse, fitted, self.best) if fitted else None

    def add(self, best: FittedChange) -> Self | None:
        """Return the problem with an effect more; earlier ones that predict nothing beside it go."""
        pulse = replace(self.pulse, found=(*self.pulse.found, best.change))
        pulse = pulse.prepared(best.x)
        found = fit(pulse, best.x, pulse.duration, iterations=4)
        if found is None:
            return None
        kept = []
        for each in self.named:
            at = pulse.priors + sum(c.size for c in pulse.found[: pulse.found.index(each.change)])
            fewer = replace(pulse, found=tuple(c for c in pulse.found if c is not each.change))
            start = np.delete(found.x, range(at, at + each.change.size))
            less = fit(fewer, start, pulse.duration, iterations=4)
            if less is not None and rise(score_of(pulse, found), score_of(fewer, less)) < -np.log(
                self.policy.chance
            ):
                pulse, found = fewer, less
            else:
                kept.append(each)
        drop = (_part_of_budget(best.change), self.best.cost - found.cost)
        return replace(self, pulse=pulse, best=found, named=(*kept, best), drops=(*self.drops, drop))

    def units(self, fitted: FittedChange) -> dict[str, str]:
        """Return the units of an effect's parameters."""
        return fitted.change.units

    def residual(self, straight: Self) -> Residual:
        """Return what the effects leave of the first gap."""
        rows = self.pulse.rows()
        share = share_beyond_noise((straight.best.cost, rows), (self.best.cost, rows), self.policy)
        return Residual(share, self.policy.unexplained, data="this record")

    def budget(self, first: Self, last: Self) -> Budget:
        """Return what the mean square gap is made of, relative to the records' own."""
        start = first.pulse.residuals(first.pulse.start(), first.pulse.duration)
        total = first.best.cost if start is None else float(start @ start)
        noise = min(first.pulse.rows(), total)
        # Beside a large gap the coefficients are dragged after it: what they then win is the effects' own.
        dragged = 0.0 if last.drops and not first.drags else max(total - first.best.cost, 0.0)
        parts = {"state": dragged, "history": 0.0, "run": max(last.best.cost - noise, 0.0)}
        for kind, drop in last.drops:
            parts[kind] += max(drop, 0.0)
        whole = max(sum(parts.values()), 1e-300)
        own, step = first.power()
        shares = {kind: part / whole for kind, part in parts.items()}
        return divide_gap(total / own, noise / own, step / own, lambda _: shares)

    #: Whether what the numbers of laws and structure win at first is theirs beside effects, too.
    drags: ClassVar[bool] = False

    def power(self) -> tuple[float, float]:
        """Return the squares of the records, and of what the time step does to them, in units of noise."""
        pulse = self.pulse
        own = sum(
            float(np.sum((r.displacement - r.displacement.mean()) ** 2)) / n.weight**2
            for r, n in zip(pulse.records, pulse.noise, strict=True)
        )
        step = sum(float(e @ e) / n.weight**2 for e, n in zip(pulse.step_error, pulse.noise, strict=False))
        return own, step

    def places(self) -> tuple[Place, ...]:
        """Return where the gap of the model as it was given lies."""
        return most_informative(locate_gap(self.pulse), self.policy, one_per_axis=True)

    def separating_runs(
        self, step: Step, ranking: Ranking[FittedChange], search: Portion, say: Say
    ) -> tuple[tuple[Advice, ...], int, int]:
        """Return the pulse that would tell the two likeliest members of a class apart, and how many were tried."""
        return separating_pulses(self.pulse, ranking.members, self.period, search, say)

    def diagnosis(self, first: Self, found: Mapping[str, Any]) -> Diagnosis:
        """Return the result."""
        after, whole = whole_model(self.pulse, self.best)
        return Diagnosis(
            **found,
            warnings=(
                *warnings_of(
                    self.pulse, self.records, self.hidden is not None, self.drawn, bool(self.others)
                ),
                *self.beyond,
            ),
            model=after,
            whole=whole,
            hidden=self.hidden,
            source="structure",
            rig=self.pulse.rig.name,
            records=self.records,
        )


def _part_of_budget(change: Change) -> str:
    """Return the part of the budget that an effect belongs to."""
    return (
        "run"
        if not change.inside
        else "history"
        if any(v.states for v in change.effect.variants)
        else "state"
    )


def whole_model(problem: PulseProblem, best: Fit) -> tuple[JointModel, JointModel]:
    """Return the model with its numbers beside the effects, and with what these change in the joint's law.

    That is terms, and elements with a memory; effects outside of the joint belong to the structure. The covariance is
    that of the fit, by linearisation.
    """
    changes = [change for change in problem.found if change.inside]
    own, inverse = slice(2, problem.priors), covariance_of(best.jacobian)
    after = problem.kind.with_numbers(best.x[own], inverse[own, own])
    if not changes:
        return after, after

    def assembled(x: Array) -> JointModel:
        return assemble_model(problem.setup(x).numbers, problem.kind.laws, after, changes)

    return after, with_slopes(assembled, best.x, problem.bounds()[1], inverse)


def warnings_of(
    problem: PulseProblem, records: Sequence[RecordGap], virtual: bool, drawn: bool, others: bool
) -> tuple[str, ...]:
    """Return what to know before believing the diagnosis.

    Records may be simulated (``virtual``), the model be ``drawn`` from the rig's own law, and ``others`` be held out.
    """
    said = [
        (virtual, "the response is simulated (a virtual pulse test of the rig), not measured"),
        (
            drawn,
            "no model was given: the terms of the rig's own joint were taken as known to "
            f"{100 * problem.policy.trivial_share:.3g} %",
        ),
        (
            not others,
            f"one pulse only: the model is fitted to its first {records[0].held_from:.3g} s, the gaps are those of "
            "what follows",
        ),
        *(
            (
                noise.length > 3,
                f"the noise at {record.point} is not white: {noise.length:.3g} neighbouring samples count as one",
            )
            for record, noise in zip(problem.records, problem.noise, strict=True)
        ),
        (
            any(
                np.sqrt(np.mean(error**2)) > 3 * noise.sigma
                for error, noise in zip(problem.step_error, problem.noise, strict=False)
            ),
            f"the time step of {problem.rig.step:g} s is coarse for this noise; reduce step in [output]",
        ),
    ]
    return tuple(words for so, words in said if so)
