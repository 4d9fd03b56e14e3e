"""Result of a verification: by run, over all runs, and the verdict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from sindyjoint.described import Shown, same
from sindyjoint.equation.model import JointModel
from sindyjoint.limits import RESPONSE
from sindyjoint.numeric import Array, rms
from sindyjoint.response.laws import draw_models
from sindyjoint.response.oscillations import Oscillation
from sindyjoint.response.run import WINDOW, pooled_nrmse
from sindyjoint.text import list_some
from sindyjoint.trust import Trust


@dataclass(frozen=True, eq=False)
class Settings:
    """How a model is held against a response.

    Parameters
    ----------
    tolerance : float
        Largest response NRMSE beyond the noise floor that passes.
    draws : int
        Sets of coefficients drawn from the model's covariance for the band; 0: no band.
    generator : Generator
        Of these, and of noise.
    window : float
        Length of a multiple-shooting segment, for joints without restoring moment, s.
    free_run : int or None
        First samples on which the initial state of each run is estimated, which is then simulated without restart.
    """

    tolerance: float
    draws: int
    generator: np.random.Generator
    window: float = WINDOW
    free_run: int | None = None

    def drawn(self, model: JointModel) -> list[JointModel]:
        """Return the sets of coefficients for the band."""
        return draw_models(model, self.draws, self.generator)


@dataclass(frozen=True, eq=False)
class Band:
    """Where 95 % of the responses lie that the uncertainty of the coefficients allows.

    Parameters
    ----------
    low, high : ndarray, shape (n,)
    draws : int
        Simulated sets of coefficients.
    failed : int
        Sets whose simulation left the law's range; they are not in the band.
    """

    low: Array
    high: Array
    draws: int
    failed: int


@dataclass(frozen=True, eq=False)
class Cycles:
    """Half-cycles of the measured and of the simulated response."""

    measured: Oscillation | None
    simulated: Oscillation | None


@dataclass(frozen=True, eq=False)
class Energies:
    """Energy dissipated in each cycle of the measured and of the simulated response, J."""

    measured: Array
    simulated: Array


@dataclass(frozen=True, eq=False)
class RunVerification:
    """One run, or one pulse test, against its simulation.

    Parameters
    ----------
    name : str
    channel : {"angle", "moment", "displacement", "acceleration", "velocity"}
        What the response is.
    drive : str
        How it was simulated: "moment", "windows", "motion", "free run" or "pulse"; of a run of a structure "steady" or
        "standstill".
    time, measured : ndarray, shape (n,)
    simulated : ndarray, shape (n,), or None
    band : Band or None
    response_nrmse, moment_nrmse, noise_floor : float or None
        Relative to the RMS of what was measured.
    amplitude_rms_error : float or None
        Relative to the first measured amplitude.
    mean_period_difference : float or None
        s.
    oscillations : pair of Oscillation or None
        Measured and simulated.
    energy : ndarray, shape (2, cycles), or None
        Energy dissipated per cycle, measured and simulated, J.
    failure : str
    scale, moment_scale : float, optional
        RMS that the errors of response and moment are relative to, SI.
    rmse : float, optional
        RMS error of the response in ``rmse_unit``.
    rmse_unit : str
        In which the channel stands in its file, before a gain; SI for one that was read from none.
    seen : bool or None
        Whether a fit of the model has used the run; None where that is not known.
    """

    WRITTEN: ClassVar = same("name", "response_nrmse", "moment_nrmse", "rmse", "rmse_unit", "seen")
    FILED: ClassVar = {
        **same("drive", "channel", "noise_floor", "amplitude_rms_error", "mean_period_difference"),
        "failure": "fault",
        **same("cycles", "energy_per_cycle"),
    }
    name: str
    channel: str
    drive: str
    time: Array
    measured: Array
    simulated: Array | None
    band: Band | None
    response_nrmse: float | None
    moment_nrmse: float | None
    noise_floor: float | None
    amplitude_rms_error: float | None
    mean_period_difference: float | None
    oscillations: tuple[Oscillation | None, Oscillation | None]
    energy: Array | None
    failure: str = ""
    scale: float | None = None
    moment_scale: float | None = None
    rmse: float | None = None
    rmse_unit: str = ""
    seen: bool | None = None

    @property
    def beyond_noise(self) -> float:
        """Response error that the noise does not account for; infinite for a failed simulation."""
        if self.response_nrmse is None:
            return float("inf")
        return float(np.sqrt(max(self.response_nrmse**2 - (self.noise_floor or 0.0) ** 2, 0.0)))

    @property
    def fault(self) -> str | None:
        """Why it could not be simulated."""
        return self.failure or None

    @property
    def cycles(self) -> Cycles:
        """Half-cycles of both responses."""
        return Cycles(*self.oscillations)

    @property
    def energy_per_cycle(self) -> Energies | None:
        """Dissipated in each cycle, J."""
        return None if self.energy is None else Energies(*self.energy)


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Shown):
    """The result of :func:`verify`.

    Parameters
    ----------
    model : JointModel
    kind : {"rig", "campaign"}
    subject : str
        What the model was compared with.
    verdict : {"passed", "failed"}
    reason : str
        One sentence.
    tolerance : float
    response_nrmse, moment_nrmse, noise_floor, amplitude_rms_error, mean_period_difference : float or None
        Errors and noise: RMS over all runs relative to that of what was measured. Others: root mean squares over the
        runs (of the period: the mean).
    runs : tuple of RunVerification
    warnings : tuple of str
    free_run : int, optional
        Samples from which the initial state of each run was estimated, that was then simulated without restart.
    beyond_range : tuple of str
        Runs that go beyond what the model was tested to.
    beside : tuple of JointModel
        Those of further kinds of joint in a structure.
    trust : Trust, optional
        Of the model and what it was compared with.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar[dict[str, Any]] = same(
        *("verdict", "trust", "response_nrmse", "moment_nrmse", "noise_floor", "amplitude_rms_error"),
        *("mean_period_difference", "free_run", "runs", "warnings"),
    )
    FILED: ClassVar = {"subject": {"kind": "kind", "name": "subject"}, **same("reason", "tolerance")}
    model: JointModel
    kind: str
    subject: str
    verdict: str
    reason: str
    tolerance: float
    response_nrmse: float | None
    moment_nrmse: float | None
    noise_floor: float | None
    amplitude_rms_error: float | None
    mean_period_difference: float | None
    runs: tuple[RunVerification, ...] = field(repr=False)
    warnings: tuple[str, ...] = ()
    free_run: int | None = None
    beyond_range: tuple[str, ...] = ()
    beside: tuple[JointModel, ...] = ()
    trust: Trust | None = None

    @property
    def passed(self) -> bool:
        """Whether the model was verified."""
        return self.verdict == "passed"


def seen_words(seen: Mapping[str, bool | None]) -> list[str]:
    """Return what to say of runs that fits of the model have seen, or may have."""
    lines = (
        (True, "a fit of the model has used {}: the error there is no prediction"),
        (None, "the model does not record whether a fit has used {}: the error there may be no prediction"),
    )
    groups = ((line, [name for name, known in seen.items() if known is used]) for used, line in lines)
    return [line.format(list_some(names)) for line, names in groups if names]


def band_of(responses: Sequence[Array | None]) -> Band | None:
    """Return the band of simulated responses; ``None`` with too few of them."""
    good = [response for response in responses if response is not None]
    if len(good) < RESPONSE.scatter:
        return None
    middle, spread = np.mean(good, axis=0), np.std(good, axis=0, ddof=1)
    return Band(middle - 1.96 * spread, middle + 1.96 * spread, len(responses), len(responses) - len(good))


def _pool_runs(values: Sequence[float | None], mean: Callable[[Array], Any]) -> float | None:
    known = np.array([value for value in values if value is not None], dtype=float)
    return float(mean(known)) if known.size else None


def _pooled(kind: str, runs: Sequence[RunVerification], error: str, scale: str) -> float | None:
    """Return the error of all runs together, each weighted by the square of its size."""
    known = [
        (kind or run.channel, getattr(run, error), getattr(run, scale) or 1.0)
        for run in runs
        if getattr(run, error) is not None
    ]
    return pooled_nrmse(known) if known else None


def judged(
    model: JointModel,
    kind: str,
    subject: str,
    tolerance: float,
    runs: Sequence[RunVerification],
    warnings: Sequence[str],
) -> Verification:
    """Return the verdict over all runs; for it, each counts alike."""
    failed = [run for run in runs if run.simulated is None]
    messages = [*warnings, *(f"{run.name}: {run.failure}" for run in failed)]
    messages += [
        f"{run.name}: {run.band.failed} of {run.band.draws} sets of coefficients left the law's range"
        for run in runs
        if run.band is not None and run.band.failed
    ]
    whole = None if failed else _pooled("", runs, "response_nrmse", "scale")
    floor = _pooled("", runs, "noise_floor", "scale")
    beyond = float("inf") if whole is None else rms([run.beyond_noise for run in runs])
    worst = max(runs, key=lambda run: run.beyond_noise)
    if not failed and len(runs) > 1 and worst.beyond_noise > tolerance:
        messages.append(
            f"{worst.name}: {100 * worst.beyond_noise:.1f} % of the response lies beyond the noise, the most of all "
            "runs"
        )
    if failed:
        reason = f"the simulation of {len(failed)} of {len(runs)} run(s) did not reach its end"
    else:
        reason = (
            f"{100 * beyond:.2f} % of the response is neither simulated nor noise; {100 * tolerance:.0f} % is "
            f"tolerated (NRMSE {100 * (whole or 0):.2f} %, noise floor {100 * (floor or 0):.2f} %)"
        )
    return Verification(
        model=model,
        kind=kind,
        subject=subject,
        verdict="passed" if beyond <= tolerance else "failed",
        reason=reason,
        tolerance=tolerance,
        response_nrmse=whole,
        moment_nrmse=_pooled("moment", runs, "moment_nrmse", "moment_scale"),
        noise_floor=floor,
        amplitude_rms_error=_pool_runs([run.amplitude_rms_error for run in runs], rms),
        mean_period_difference=_pool_runs([run.mean_period_difference for run in runs], np.mean),
        runs=tuple(runs),
        warnings=tuple(messages),
    )
