"""Runs of a structure as an output-error problem, those that do not repeat in segments beside those that do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.effects.structure import Change
from sindyjoint.diagnosis.structure.runs import RunsProblem
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.numeric import Array
from sindyjoint.substructure.simulated.segments import SegmentedRun
from sindyjoint.substructure.update import Update

# Step of the differences, in the scaled numbers of the fit: a simulation has events, and a smaller one would see them.
STEP = 0.05
# Draws of the noise of the drive, from which its part of the covariance follows.
DRAWS = 4


@dataclass(frozen=True, eq=False)
class RecordsProblem:
    """Runs that repeat, with the numbers of all, and runs that do not.

    Parameters
    ----------
    steady : RunsProblem
    records : tuple of SegmentedRun
    """

    steady: RunsProblem
    records: tuple[SegmentedRun, ...]
    _kept: dict[bytes, list[Array] | None] = field(default_factory=dict, repr=False)

    @property
    def duration(self) -> float:
        """No horizon: segments are short."""
        return 0.0

    @property
    def base_size(self) -> int:
        """Numbers of the base."""
        return self.steady.base_size

    @property
    def numbers(self) -> int:
        """How many uncertain numbers the structure has."""
        return self.steady.numbers

    def rows(self) -> float:
        """Return the number of residuals."""
        return self.steady.rows() + sum(record.rows for record in self.records)

    def start(self) -> Array:
        """Return the base without anything added."""
        return self.steady.start()

    def bounds(self, extra: Change | None = None) -> tuple[Array, Array]:
        """Return lower and upper bounds of the numbers."""
        return self.steady.bounds(extra)

    def residuals(self, x: Array, duration: float = 0.0, extra: Change | None = None) -> Array | None:
        """Return simulated less measured in units of noise, prior rows among them; None without a motion."""
        first, parts = self.steady.residuals(x), self._segments(x)
        return None if first is None or parts is None else np.concatenate([first, *parts])

    def _segments(self, x: Array) -> list[Array] | None:
        key = x.tobytes()
        if key not in self._kept:
            if len(self._kept) > 8:
                self._kept.clear()
            try:
                self._kept[key] = [
                    part for record in self.records for part in record.residual(self._simulated(record, x))
                ]
            except (SimulationError, InputError, np.linalg.LinAlgError):
                self._kept[key] = None
        return self._kept[key]

    def _simulated(self, record: SegmentedRun, x: Array) -> Any:
        setup = self.steady.setup(x)
        return record.reduced(self.steady.structure(setup, x), self.steady.laws(setup))

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, those of the segments by differences."""
        first = residual.size - sum(record.rows for record in self.records)
        _, high = self.bounds()
        columns = np.zeros((residual.size, len(places)))
        columns[:first] = self.steady.derivatives(x, residual[:first], duration, places)
        for column, place in enumerate(places):
            step = STEP if x[place] + STEP <= high[place] else -STEP
            for way in (step, -step):
                moved = x.copy()
                moved[place] += way
                parts = self._segments(moved)
                if parts is not None:
                    columns[first:, column] = (np.concatenate(parts) - residual[first:]) / way
                    break
        return columns

    def whitened(self, x: Array) -> RecordsProblem:
        """Return the problem with residuals weighed at some numbers, and segments that begin where they fit best.

        Raises
        ------
        InputError
            Where a run cannot be simulated there.
        """
        records = []
        for record in self.records:
            try:
                records.append(record.settled(self._simulated(record, x)))
            except SimulationError as error:
                raise InputError(
                    f"run {record.name!r} cannot be simulated with the model: {error}"
                ) from error
        steady = self.steady.whitened(x) if self.steady.runs else self.steady
        return replace(self, steady=steady, records=tuple(records), _kept={})

    def covariance(self, x: Array) -> Array:
        """Return the covariance of the numbers, with what the noise of the drive does through the structure.

        H⁻¹·(H + Σ gₖgₖᵀ)·H⁻¹ with H = JᵀJ and gₖ = Jₖᵀδₖ, δₖ the change of the residual of segment k by a draw of that
        noise, which is no white noise of the sensors (White, Econometrica 48(4), 1980); larger by what χ² per degree of
        freedom is above that of both noises. Prior and runs that repeat are whitened already.
        """
        residual, parts = self.residuals(x), self._segments(x)
        assert residual is not None and parts is not None
        jacobian = self.derivatives(x, residual, 0.0, range(x.size))
        normal = jacobian.T @ jacobian
        inverse = np.linalg.pinv(normal, hermitian=True)
        by_segment = np.split(
            jacobian[residual.size - sum(map(len, parts)) :], np.cumsum([*map(len, parts)])[:-1]
        )
        scatter, power = np.zeros_like(normal), 0.0
        for draw in range(DRAWS):
            for part, columns, other in zip(parts, by_segment, self._with_drive_noise(x, draw), strict=True):
                score = columns.T @ (other - part)
                scatter += np.outer(score, score) / DRAWS
                power += float(np.sum((other - part) ** 2)) / DRAWS
        degrees = max(self.rows() - x.size, 1.0)
        excess = max(1.0, float(residual @ residual) / (degrees + power))
        return np.asarray(inverse @ (normal + scatter) @ inverse * excess)

    def _with_drive_noise(self, x: Array, draw: int) -> list[Array]:
        """Return the residuals of all segments with other noise on the drive, as far as that can be simulated."""
        found = []
        for number, record in enumerate(self.records):
            simulated = self._simulated(record, x)
            try:
                found += record.with_drive_noise(np.random.default_rng([draw, number])).residual(simulated)
            except SimulationError:
                found += record.residual(simulated)
        return found

    def models(self, x: Array, covariance: Array) -> dict[str, JointModel]:
        """Return the model of each kind with the numbers of the base, whose covariance is given."""
        return self.steady.models(x, covariance)

    def update(self, x: Array, covariance: Array) -> Update | None:
        """Return the structure's uncertain numbers; None where it has none."""
        return self.steady.update(x, covariance)
