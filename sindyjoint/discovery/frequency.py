"""Whether a coefficient is the same at every frequency: homogeneity, trend, and equivalence within a margin.

"No significant difference" from few or rough estimates is no evidence of sameness, and a significant difference from
very sharp ones may be too small to matter. So there are three answers: the estimates differ by more than their errors
explain, and the change may reach half the margin; or every change larger than the margin is ruled out, and a small one
that is significant is reported with it; or these runs cannot decide.

References: Cochran 1954 (Q); Welch 1951 (its distribution with estimated variances); DerSimonian and Laird 1986 (τ);
Higgins and Thompson 2002 (I²); Schuirmann 1987 (two one-sided tests), as an intersection-union test over all pairs
(Berger 1982).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.described import Maybe
from sindyjoint.discovery import Evidence, fit_columns
from sindyjoint.errors import InputError, refuse
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array


@dataclass(frozen=True)
class Axis:
    """Over what a coefficient is looked at, its unit, and the level at which a difference is significant."""

    name: str = "frequency"
    unit: str = "Hz"
    level: float = DISCOVERY.level


FREQUENCY = Axis()


@dataclass(frozen=True)
class FrequencyTest:
    """What estimates at several frequencies say about a coefficient.

    Parameters
    ----------
    name : str
    frequencies, estimates : tuple of float
        Hz and SI units.
    standard_errors : tuple of float
        NaN where none were given.
    mean, mean_error : float
        Random-effects mean and its standard error.
    q, degrees, p_homogeneity : float
        Cochran's Q, its degrees of freedom, and its p-value by Welch's approximation; NaN without standard errors.
    i_squared : float
        Share of the scatter that errors do not explain.
    tau : float
        Standard deviation between frequencies beyond the errors; without standard errors, the plain one (ddof 1).
    slope, slope_error, p_trend : float
        Per Hz.
    change, change_bound : float
        Trend over the tested band relative to the mean, signed; and the largest change between two frequencies that
        the data leave possible at 1 % risk, relative to the smaller of the two.
    margin : float
    answer : str
    reason : str
        One sentence.
    """

    name: str
    frequencies: tuple[Maybe, ...]
    estimates: tuple[Maybe, ...]
    standard_errors: tuple[Maybe, ...]
    mean: Maybe
    mean_error: Maybe
    q: Maybe
    degrees: int
    p_homogeneity: Maybe
    i_squared: Maybe
    tau: Maybe
    slope: Maybe
    slope_error: Maybe
    p_trend: Maybe
    change: Maybe
    change_bound: Maybe
    margin: Maybe
    answer: str
    reason: str

    @property
    def p_value(self) -> float:
        """Of "the same at every frequency": the smaller of both tests' p-values, doubled for having two."""
        values = [p for p in (self.p_homogeneity, self.p_trend) if np.isfinite(p)]
        return min(1.0, len(values) * min(values)) if values else float("nan")


@dataclass(frozen=True, eq=False)
class GroupEstimates:
    """Coefficients fitted to each single group.

    Parameters
    ----------
    ids : tuple of str
    groups : tuple of str
    coefficients : ndarray, shape (groups, k)
    covariances : ndarray, shape (groups, k, k)
    degrees : ndarray, shape (groups,)
    """

    ids: tuple[str, ...]
    groups: tuple[str, ...]
    coefficients: Array
    covariances: Array
    degrees: Array

    @property
    def standard_errors(self) -> Array:
        """Shape (groups, k)."""
        return np.sqrt(np.einsum("gii->gi", self.covariances))


def group_estimates(evidence: Evidence, columns: Sequence[int]) -> GroupEstimates:
    """Return the fits of some columns to the runs of each single group.

    A fit moves the mean of each run's scores, not their scatter about it: the factor n/(n − p), which guards the
    choice among many columns, is 1.3 for five columns and three runs of eight blocks, and is taken out here. With it
    the tests of frequency dependence reject in 1.5 % of campaigns instead of 5 %.
    """
    fits = [fit_columns(evidence.only([group]), columns) for group in evidence.groups]
    blocks = np.array([max(fit.degrees, 1) for fit in fits])
    widened = blocks / np.maximum(blocks - len(columns), 1)
    return GroupEstimates(
        ids=tuple(evidence.ids[c] for c in columns),
        groups=evidence.groups,
        coefficients=np.array([fit.coefficients for fit in fits]),
        covariances=np.array([fit.covariance for fit in fits]) / widened[:, None, None],
        degrees=blocks.astype(float),
    )


def frequency_test(
    name: str,
    frequencies: ArrayLike,
    estimates: ArrayLike,
    standard_errors: ArrayLike | None = None,
    degrees: ArrayLike | None = None,
    margin: float = DISCOVERY.margin,
    axis: Axis = FREQUENCY,
) -> FrequencyTest:
    """Test whether estimates at several frequencies are the same.

    Parameters
    ----------
    name : str
        Of the coefficient.
    frequencies, estimates : array_like, shape (g,)
        Hz; at least three different ones.
    standard_errors : array_like, shape (g,), optional
        Including that of any correction. ``None``: the errors follow from the scatter about a straight line.
    degrees : array_like, shape (g,), optional
        Degrees of freedom of the standard errors. Default: they are known exactly.
    margin : float
        Relative change over the band that would not matter.
    axis : Axis
        What stands in the place of frequency, in words.

    Raises
    ------
    InputError
        For fewer than three frequencies, shapes that differ, or values that are not finite.
    """
    f, x = np.asarray(frequencies, dtype=float), np.asarray(estimates, dtype=float)
    count, finite = np.unique(f).size, np.all(np.isfinite(f)) and np.all(np.isfinite(x))
    refuse(
        [
            (
                f.shape != x.shape or f.ndim != 1 or count < 3,
                f"{name}: estimates of shape {x.shape} at {count} frequencies; expected three or more",
            ),
            (
                not (finite and margin > 0),
                f"{name}: expected frequencies, estimates and a positive margin, all finite",
            ),
        ]
    )
    band, nan = float(np.ptp(f)), float("nan")
    if standard_errors is None:
        # The scatter about the straight line gives the errors.
        q = p_homogeneity = i_squared = spread = nan
        s, left = np.full(x.shape, nan), float(x.size - 2)
        mean, tau = float(x.mean()), float(x.std(ddof=1))
        slope, unit = weighted_slope(f, x, np.ones(x.shape))
        residual = x - mean - slope * (f - f.mean())
        mean_error, slope_error = tau / np.sqrt(x.size), unit * float(np.sqrt(residual @ residual / left))
        once, twice = scipy.special.stdtrit(left, [1 - DISCOVERY.level, 1 - DISCOVERY.level / 2]).tolist()
        bound = (abs(slope) + once * slope_error) * band / abs(mean) if mean else np.inf
    else:
        s = np.asarray(standard_errors, dtype=float)
        if s.shape != x.shape or not np.all(np.isfinite(s) & (s > 0)):
            raise InputError(f"{name}: expected one positive standard error for each estimate")
        nu = np.full(x.shape, 1e9) if degrees is None else np.asarray(degrees, dtype=float)
        q, p_homogeneity, i_squared, tau = heterogeneity(x, s, nu)
        weight = 1 / (s**2 + tau**2)
        mean, mean_error = float(weight @ x / weight.sum()), float(weight.sum() ** -0.5)
        slope, slope_error = weighted_slope(f, x, s)
        left, twice, spread = float(nu.sum()), 1.96, tau / abs(mean) if mean else np.inf
        bound = _largest_change(x, s, nu)
    p_trend = (
        2 * float(scipy.special.stdtr(left, -abs(slope) / slope_error))
        if slope_error > 0
        else float(slope == 0)
    )
    change = slope * band / mean if mean else nan
    test = FrequencyTest(
        name, tuple(f), tuple(x), tuple(s), mean, mean_error, q, x.size - 1, p_homogeneity, i_squared, tau, slope,
        slope_error, p_trend, change, bound, margin, "", "",
    )  # fmt: skip
    answer, reason = _answer(test, axis, twice * slope_error * band / abs(mean) if mean else np.inf, spread)
    return replace(test, answer=answer, reason=reason)


def heterogeneity(x: Array, s: Array, nu: Array) -> tuple[float, float, float, float]:
    """Return Cochran's Q, its p-value, I² and DerSimonian and Laird's τ.

    Q = Σ w(x − x̄)², w = 1/s². With estimated variances Q is too large on average; Welch's F corrects it:
    F = Q/(g−1) / (1 + 2(g−2)/(g²−1)·Λ) on (g−1, (g²−1)/(3Λ)) degrees, Λ = Σ (1 − w/Σw)²/ν.
    """
    g = x.size
    w = 1 / s**2
    q = float(w @ (x - w @ x / w.sum()) ** 2)
    spare = float(np.sum((1 - w / w.sum()) ** 2 / nu))
    f = q / (g - 1) / (1 + 2 * (g - 2) / (g**2 - 1) * spare)
    p = float(scipy.special.fdtrc(g - 1, (g**2 - 1) / (3 * spare), f))
    tau_squared = max(0.0, (q - (g - 1)) / (w.sum() - (w**2).sum() / w.sum()))
    return q, p, max(0.0, 1 - (g - 1) / q) if q > 0 else 0.0, float(np.sqrt(tau_squared))


def weighted_slope(f: Array, x: Array, s: Array) -> tuple[float, float]:
    """Return slope per Hz and its standard error by weighted least squares."""
    w = 1 / s**2
    centre = f - w @ f / w.sum()
    spread = float(w @ centre**2)
    return float(w @ (centre * x)) / spread, spread**-0.5


def detectable_change(test: FrequencyTest) -> float:
    """Return the relative change over the band that a trend test would find in four of five cases."""
    degrees = len(test.estimates) - 2 if np.isnan(test.p_homogeneity) else 1e6
    need = float(
        scipy.special.stdtrit(degrees, 1 - DISCOVERY.level / 2) + scipy.special.stdtrit(degrees, 0.8)
    )
    return need * test.slope_error * (max(test.frequencies) - min(test.frequencies)) / abs(test.mean)


def _largest_change(x: Array, s: Array, nu: Array) -> float:
    """Return the largest difference of two frequencies still possible, 1 % risk, relative to the smaller value.

    Infinite where the values differ in sign: there is no telling what such a change is a share of.
    """
    if np.min(x) <= 0 <= np.max(x):
        return float("inf")
    i, j = np.triu_indices(x.size, 1)
    ordered = np.abs(x[i]) <= np.abs(x[j])
    i, j = np.where(ordered, i, j), np.where(ordered, j, i)
    # Of the ratio x_j/x_i to the smaller one: its error counts as often as it is contained in the larger.
    ratio = x[j] / x[i]
    lower, upper = (ratio * s[i] / x[i]) ** 2, (s[j] / x[i]) ** 2
    variance = lower + upper
    degrees = variance**2 / (lower**2 / nu[i] + upper**2 / nu[j])
    quantile = scipy.special.stdtrit(degrees, 1 - DISCOVERY.strict_level)
    return float(np.max(ratio - 1 + quantile * np.sqrt(variance)))


def _answer(test: FrequencyTest, axis: Axis, uncertainty: float, spread: float) -> tuple[str, str]:
    """Return the answer and its reason; ``uncertainty`` is half the 95 % interval of the change over the band."""
    p, margin, bound = test.p_value, test.margin, test.change_bound
    tested = f"over {min(test.frequencies):.3g} to {max(test.frequencies):.3g} {axis.unit}"
    trend = f"a trend of {100 * test.change:+.1f} % ± {100 * uncertainty:.1f} %"
    if np.isfinite(spread):
        trend += f", spread beyond the errors {100 * spread:.1f} %"
    if p < axis.level and bound >= DISCOVERY.mostly * margin:
        within = f"; beyond {100 * bound:.1f} % it is ruled out" if bound < margin else ""
        return f"depends on {axis.name}", f"{trend} {tested} (p = {p:.2g}){within}"
    if bound < margin:
        ruled_out = (
            f"every change {tested} beyond {100 * bound:.1f} % is ruled out, which is below the margin of "
            f"{100 * margin:.0f} %"
        )
        if p < axis.level:
            ruled_out += f"; a smaller one is there, and significant: {trend} (p = {p:.2g})"
        return "independent within margin", ruled_out
    return (
        "cannot tell",
        f"no change {tested} is seen (p = {p:.2g}), but one of {100 * bound:.0f} % is not ruled out; "
        f"margin {100 * margin:.0f} %",
    )
