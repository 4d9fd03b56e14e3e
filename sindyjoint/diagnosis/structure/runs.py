"""The runs of a structure as an output-error problem: laws of its joints, its own numbers, effects added so far.

Each run's steady motion is that of harmonic balance; derivatives follow from the balance itself, without a further
simulation. Unknown are the laws' numbers, the structure's uncertain numbers under the priors that its file states (as
the runs whose joints stick have updated them), and the numbers of effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.clock import spend
from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.structure import OutputError, covariance_of, differences, parted
from sindyjoint.diagnosis.structure.kinds import JointKind, kinds_of
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.mechanics.structure import Hinge, Structure
from sindyjoint.numeric import COARSE_DIFFERENCE, Array
from sindyjoint.substructure.recovery import Recovery, Update, held_spectra, update_structure, with_numbers
from sindyjoint.substructure.simulated import Answer, SteadyRun
from sindyjoint.substructure.steady_response import Condensed, Steady

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class RunsProblem(OutputError):
    """Runs of a structure, models in its joints, and the effects named so far.

    Parameters
    ----------
    test : RigTest
        As it is described.
    kinds : tuple of JointKind
    runs : tuple of SteadyRun
    known : bool
        Whether the laws' numbers keep to their covariance, as where they come from another test.
    whitening : tuple of ndarray
        Of each run's residuals; empty for none.
    found : tuple of Change
    prior : Update or None
        The structure's uncertain numbers by the runs whose joints stick; None where there are none, and the priors of
        the file hold.
    policy : DiagnosisPolicy
    """

    test: RigTest
    kinds: tuple[JointKind, ...]
    runs: tuple[SteadyRun, ...]
    known: bool = False
    whitening: tuple[Array, ...] = ()
    found: tuple[Change, ...] = ()
    prior: Update | None = None
    policy: DiagnosisPolicy = STRUCTURE
    _kept: dict[object, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls,
        test: RigTest,
        recoveries: Sequence[Recovery],
        models: Mapping[str, JointModel],
        known: bool = False,
        policy: DiagnosisPolicy = STRUCTURE,
        fitted: bool = True,
    ) -> RunsProblem:
        """Return the problem of a test with a model for each kind of its joints.

        Runs that are ``fitted`` are weighed with the models, near whose motions others are sought; those that are kept
        out have motions near those recovered, whatever the model.

        Raises
        ------
        InputError
            Where a kind has no model, or the runs cannot be simulated with the models.
        """
        recoveries = [each for each in recoveries if each.spectra.repeats]
        if not recoveries:
            raise InputError("no run repeats; the steady response is simulated of runs whose drive does")
        problem = replace(cls.with_models(test, models, policy), known=known)
        problem = replace(problem, runs=tuple(SteadyRun.of(test, r) for r in recoveries))
        return problem.whitened(problem.start()) if fitted else problem

    @classmethod
    def with_models(
        cls, test: RigTest, models: Mapping[str, JointModel], policy: DiagnosisPolicy = STRUCTURE
    ) -> RunsProblem:
        """Return the problem without runs, the structure's numbers updated by those whose joints stick."""
        prior = update_structure(test, (), held_spectra(test)) if test.update_runs else None
        return cls(test, kinds_of(test, models, policy.granted_share), (), prior=prior, policy=policy)

    @property
    def duration(self) -> float:
        """No horizon: a steady state is compared as a whole."""
        return 0.0

    def rows(self, duration: float | None = None) -> float:
        """Return the number of residuals."""
        return float(sum(run.rows for run in self.runs))

    @property
    def groups(self) -> NDArray[np.intp]:
        """Of each residual what is predicted together from the others: runs, and the priors."""
        parts = parted([run.rows for run in self.runs])
        return np.append(parts, np.full(len(range(self.priors)[self._with_prior]), len(parts)))

    @property
    def numbers(self) -> int:
        """How many uncertain numbers the structure has."""
        return len(self.test.uncertain)

    @property
    def priors(self) -> int:
        """Numbers of structure and laws, which come first."""
        return self.numbers + sum(kind.size for kind in self.kinds)

    @property
    def free(self) -> Array:
        """How far each number with a prior may move, in its standard errors; laws' numbers without one, further."""
        free = np.full(self.priors, 8.0)
        if not self.known:
            # Laws' numbers without a prior may move by so many of their standard errors.
            free[self.numbers :] = 300.0
        return free

    def parts(self, x: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Return the numbers of each kind among those of the base."""
        ends = np.cumsum([self.numbers, *(kind.size for kind in self.kinds)])
        return {k.name: x[a:b] for k, a, b in zip(self.kinds, ends[:-1], ends[1:], strict=True)}

    def changes(self, x: Array) -> Array:
        """Return the relative changes of the structure's uncertain numbers."""
        moved = self._root @ x[: self.numbers]
        return moved if self.prior is None else self.prior.change + moved

    @cached_property
    def _root(self) -> Array:
        """L of the prior covariance L·Lᵀ of the structure's uncertain numbers."""
        if self.prior is not None:
            return np.asarray(np.linalg.cholesky(self.prior.covariance))
        return np.diag([number.uncertainty for number in self.test.uncertain])

    def setup(self, x: Array, extra: Change | None = None) -> Setup:
        """Return the setup of some numbers."""
        own = self.parts(x)
        chain = self.test.chain
        setup = Setup(
            chain.items if chain else (), 1 / chain.clamp_stiffness if chain else 0.0, {},
            kinds={kind.name: kind.setup(own[kind.name]) for kind in self.kinds},
        )  # fmt: skip
        return self.changed(setup, x, extra)

    def structure(self, setup: Setup, x: Array) -> Structure:
        """Return the structure of a setup."""
        chain, test = self.test.chain, self.test
        if chain and (setup.items != chain.items or setup.compliance != 1 / chain.clamp_stiffness):
            clamp = np.inf if setup.compliance <= 0 else 1 / setup.compliance
            test = replace(
                test, structure=replace(chain, items=setup.items, clamp_stiffness=clamp).assembled()
            )
        return with_numbers(test, self.changes(x)).structure if self.numbers else test.structure

    def laws(self, setup: Setup) -> tuple[Any, ...]:
        """Return the law of every joint."""
        by_place = {
            place: law
            for kind in self.kinds
            for law in (kind.laws.law(setup.kinds[kind.name]),)
            for place in kind.places
        }
        return tuple(by_place[place] for place in range(self.test.structure.n_joints))

    def balance(self, run: SteadyRun, x: Array, extra: Change | None = None) -> tuple[Steady, Setup]:
        """Return the balance of a run, and the setup that it is of."""
        # About as long as a harmonic balance takes, by joint, in samples of a trial.
        spend(2e4 * self.test.structure.n_joints)
        setup = self.setup(x, extra)
        if not all(np.isfinite(value) for own in setup.kinds.values() for value in own.numbers.values()):
            raise InputError("a number of the law is not finite")
        structure, condensed = self._condensed(run, setup, x)
        balance = run.balance(structure, self.laws(setup), condensed)
        return (balance if setup.pulse == 1 else balance.with_drive(setup.pulse * run.drive)), setup

    def _condensed(self, run: SteadyRun, setup: Setup, x: Array) -> tuple[Structure, Condensed]:
        """Return the structure of a setup at the harmonics of a run; most candidates leave it as it is."""
        rest = tuple(item for item in setup.items if not isinstance(item, Hinge))
        key = "structure", run.omega, rest, setup.compliance, x[: self.numbers].tobytes()
        found = self._kept.get(key)
        if found is None:
            structure = self.structure(setup, x)
            found = self._keep(key, (structure, run.condensed(structure)))
        return found

    def _keep(self, key: object, value: Any) -> Any:
        if len(self._kept) > 200:
            self._kept.clear()
        self._kept[key] = value
        return value

    def answer(self, place: int, x: Array, extra: Change | None = None) -> tuple[Answer, Complex] | None:
        """Return the motion of a run and what its sensors record; None where there is none."""
        key = place, x.tobytes(), id(extra), tuple(map(id, self.found))
        known = self._kept.get(key, self)
        if known is not self:
            return known
        run, found = self.runs[place], None
        with suppress(SimulationError, InputError, np.linalg.LinAlgError):
            balance, setup = self.balance(run, x, extra)
            answer = run.answer(balance)
            found = answer, recorded(run, answer.shown, setup)
        self._keep(key, found)
        return found

    def residuals(self, x: Array, duration: float = 0.0, extra: Change | None = None) -> Array | None:
        """Return simulated less measured in units of noise, run by run, then the prior rows; None without a motion."""
        parts = []
        for place, run in enumerate(self.runs):
            found = self.answer(place, x, extra)
            if found is None:
                return None
            parts.append(self._white(place, run.residual(found[1])))
        return np.concatenate([*parts, x[self._with_prior]])

    @property
    def _with_prior(self) -> slice:
        return slice(0, self.priors if self.known else self.numbers)

    def _white(self, place: int, values: Array) -> Array:
        if not self.whitening:
            return values
        return np.asarray(
            scipy.linalg.solve_triangular(self.whitening[place], values, lower=True, check_finite=False)
        )

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, from the balance itself, shape (rows, len(places))."""
        _, high = self.bounds(extra)
        columns = np.zeros((residual.size, len(places)))
        first = 0
        for number, run in enumerate(self.runs):
            found = self.answer(number, x, extra)
            assert found is not None
            rows = slice(first, first + run.rows)
            first = rows.stop
            for column, place in enumerate(places):
                step = (
                    COARSE_DIFFERENCE if x[place] + COARSE_DIFFERENCE <= high[place] else -COARSE_DIFFERENCE
                )
                moved = x.copy()
                moved[place] += step
                try:
                    other, setup = self.balance(run, moved, extra)
                    shown = recorded(run, run.moved(found[0], other, extra is None), setup)
                except (SimulationError, InputError):
                    continue
                columns[rows, column] = (
                    self._white(number, run.residual(shown) - run.residual(found[1])) / step
                )
        prior = np.arange(x.size)[self._with_prior]
        for row, place in enumerate(prior, first):
            columns[row] = np.equal(places, place)
        return columns

    def covariance(self, x: Array) -> Array:
        """Return the covariance of the base's numbers, (JᵀJ)⁻¹, larger by χ² per degree of freedom above one."""
        residual = self.residuals(x)
        assert residual is not None
        jacobian = self.derivatives(x, residual, 0.0, range(x.size))
        return np.asarray(
            covariance_of(jacobian) * max(1.0, float(residual @ residual) / max(self.rows() - x.size, 1.0))
        )

    def models(self, x: Array, covariance: Array) -> dict[str, JointModel]:
        """Return the model of each kind with the numbers of the base, whose covariance is given."""
        places = self.parts(np.arange(x.size))
        return {
            kind.name: kind.with_numbers(x[own], covariance[np.ix_(own, own)])
            for kind, own in zip(self.kinds, places.values(), strict=True)
        }

    def update(self, x: Array, covariance: Array) -> Update | None:
        """Return the structure's uncertain numbers; None where it has none."""
        if not self.numbers:
            return None
        prior = np.array([number.uncertainty for number in self.test.uncertain])
        own = self._root @ covariance[: self.numbers, : self.numbers] @ self._root.T
        return Update(tuple(number.name for number in self.test.uncertain), prior, self.changes(x), own)

    def near(self, x: Array) -> RunsProblem:
        """Return the problem whose motions are those at some numbers moved to first order: quick, for a first look."""
        answers = tuple(self.answer(place, x) for place in range(len(self.runs)))
        known = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "_kept"}
        return NearRuns(**known, answers=answers)

    def whitened(self, x: Array, extra: Change | None = None) -> RunsProblem:
        """Return the problem with residuals whitened at some numbers, and motions sought near those there.

        Raises
        ------
        InputError
            Where a run has no steady motion there.
        """
        runs, factors = [], []
        structure = self.structure(self.setup(x, extra), x)
        for place, run in enumerate(self.runs):
            found = self.answer(place, x, extra)
            if found is None:
                raise InputError(
                    f"run {run.name!r}: no steady motion is found with the model near the one that was recovered"
                )
            runs.append(run.begun_at(found[0]))
            factors.append(run.whitening(found[0], structure))
        return replace(self, runs=tuple(runs), whitening=tuple(factors), _kept={})


@dataclass(frozen=True, eq=False)
class NearRuns(RunsProblem):
    """Runs whose motions are moved to first order from known ones.

    Parameters
    ----------
    answers : tuple
        Of each run; None where there is none.
    """

    answers: tuple[tuple[Answer, Complex] | None, ...] = ()

    def answer(self, place: int, x: Array, extra: Change | None = None) -> tuple[Answer, Complex] | None:
        """Return the motion of a run, moved from the known one, and what its sensors record."""
        known, run = self.answers[place], self.runs[place]
        if known is None:
            return None
        try:
            balance, setup = self.balance(run, x, extra)
            out, _ = balance.residual(known[0].angles, slopes=False)
        except (SimulationError, InputError):
            return None
        angles = known[0].angles + known[0].moved(out)
        shown = run.seen(balance.shown(angles))
        return Answer(balance, angles, shown), recorded(run, shown, setup)

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, by differences, shape (rows, len(places))."""
        here = self.residuals(x, duration, extra)
        if here is None:
            return np.zeros((residual.size, len(places)))
        steps = np.full(x.size, COARSE_DIFFERENCE)
        return differences(
            lambda at: self.residuals(at, duration, extra), x, here, places, steps, self.bounds(extra)[1]
        )


def recorded(run: SteadyRun, shown: Complex, setup: Setup) -> Complex:
    """Return what sensors with a gain and a delay record."""
    if setup.gain == 1 and not setup.delay:
        return shown
    orders = np.arange(1, shown.shape[1] + 1)
    return np.asarray(setup.gain * shown * np.exp(-1j * orders * run.omega * setup.delay))
