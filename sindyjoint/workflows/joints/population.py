"""A coefficient over many joints: how they scatter, which of them stand out, and whether there is a trend.

Joints are a sample: each has its true coefficient, and its estimate an error of known size on top,
y_i = μ + u_i + e_i with u_i ~ (0, τ²) and e_i ~ (0, s_i²). A joint is an outlier where y_i leaves the distribution of
the others by more than both variances explain. Everything is robust: a fifth of bad joints neither hides itself nor
makes good ones look bad.

References: Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993 (modified z-score, the median and 1.4826 MAD,
here with the error of each estimate in the scale); Rousseeuw and Leroy, Robust Regression and Outlier Detection, 1987,
chapter 1 (reweighting after rejection); Paule and Mandel, J. Res. NBS 87, 1982 (τ); Huber, Robust Statistics, 1981;
Long and Ervin, The American Statistician 54, 2000 (HC3); Holm, Scand. J. Statist. 6, 1979.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sindyjoint.described import Maybe, same
from sindyjoint.errors import refuse
from sindyjoint.numeric import MEDIAN_SQUARE, Array
from sindyjoint.policy import SHARED as POLICY


@dataclass(frozen=True)
class Trend:
    """A coefficient's change with something that is known of every joint.

    Parameters
    ----------
    coefficient, covariate : str
    slope, slope_error : float
        Per unit of the covariate; HC3 standard error.
    p_value, p_adjusted : float
        Of no trend, two-sided; and by Holm over all coefficients and covariates.
    change : float
        Over the range of the covariate, relative to the mean, signed.
    joints : int
    """

    WRITTEN: ClassVar = {
        "term": "coefficient",
        **same("covariate", "slope"),
        "standard_error": "slope_error",
        "relative_change": "change",
        "p": "p_value",
        **same("p_adjusted", "significant", "joints"),
    }
    coefficient: str
    covariate: str
    slope: Maybe
    slope_error: Maybe
    p_value: Maybe
    p_adjusted: Maybe
    change: Maybe
    joints: int

    @property
    def significant(self) -> bool:
        """Whether it stands at 5 % over all that was looked for."""
        return self.p_adjusted < POLICY.level


@dataclass(frozen=True)
class Outlier:
    """A joint that stands out."""

    id: str
    score: Maybe
    p: Maybe


@dataclass(frozen=True)
class CoefficientScatter:
    """How one coefficient scatters over the joints.

    Parameters
    ----------
    coefficient : str
    mean, mean_error : float
        Of the joints that were not rejected; at the mean of the covariate where there is a trend.
    spread : float
        τ, standard deviation between joints beyond the estimates' errors.
    scores : tuple of float
        Modified z-score of each joint; NaN where it has no value.
    p_adjusted : tuple of float
        Of "drawn from the same distribution", by Holm over all joints and coefficients.
    covariate : str or None
        With which there is a significant trend, about which the scatter is meant.
    joints : int
        That were not rejected.
    ids : tuple of str
        What the joints are called.
    """

    WRITTEN: ClassVar = {
        "term": "coefficient",
        **same("mean", "mean_error", "spread", "next_joint95"),
        "about_trend_with": "covariate",
        "outliers": "standing_out",
    }
    coefficient: str
    mean: Maybe
    mean_error: Maybe
    spread: Maybe
    scores: tuple[float, ...]
    p_adjusted: tuple[float, ...]
    covariate: str | None = None
    joints: int = 0
    ids: tuple[str, ...] = ()

    @property
    def standing_out(self) -> tuple[Outlier, ...]:
        """Joints that stand out."""
        return tuple(Outlier(self.ids[i], self.scores[i], self.p_adjusted[i]) for i in self.outliers)

    @property
    def next_scale(self) -> float | None:
        """Scale of Student's distribution of a further joint at the mean of a covariate with a trend; None of too few.

        The true coefficient of a further joint of the same kind is y = μ + u; with its error the mean of n joints knows
        μ, and their spread τ on n − 1 degrees of freedom (Higgins, Thompson and Spiegelhalter 2009, with one more
        degree: here errors are small against τ): scale² = τ² + the mean's error².
        """
        scale = float(np.hypot(self.spread, self.mean_error))
        return scale if self.joints >= POLICY.scatter and np.isfinite(scale) else None

    @property
    def next_joint95(self) -> tuple[float, float] | None:
        """In which the coefficient of a further joint lies in 95 of 100 cases."""
        scale = self.next_scale
        if scale is None:
            return None
        half = float(scipy.special.stdtrit(self.joints - 1.0, 0.975)) * scale
        return self.mean - half, self.mean + half

    @property
    def outliers(self) -> tuple[int, ...]:
        """Numbers of the joints that stand out at 5 % over all."""
        return tuple(i for i, p in enumerate(self.p_adjusted) if p < POLICY.level)


@dataclass(frozen=True)
class Population:
    """All coefficients over all joints.

    Parameters
    ----------
    scatters : tuple of CoefficientScatter
    trends : tuple of Trend
    """

    scatters: tuple[CoefficientScatter, ...]
    trends: tuple[Trend, ...]


def population(
    values: Mapping[str, ArrayLike],
    errors: Mapping[str, ArrayLike],
    covariates: Mapping[str, ArrayLike] | None = None,
) -> Population:
    """Return scatter, outliers and trends of coefficients over joints.

    Parameters
    ----------
    values, errors : mapping of str to array_like, shape (joints,)
        Estimates of each coefficient and their standard errors; NaN where a joint has none.
    covariates : mapping of str to array_like, shape (joints,), optional
        What may explain them, such as the temperature; NaN where it is not known.

    Raises
    ------
    InputError
        For shapes that differ, or standard errors that are negative.
    """
    given = {name: (np.array(values[name], float), np.array(errors[name], float)) for name in values}
    refuse(
        (
            y.shape != s.shape or y.ndim != 1 or np.any(s < 0),
            f"{name}: values of shape {y.shape} given; expected as many errors, none negative",
        )
        for name, (y, s) in given.items()
    )
    data = {name: (np.where(np.isfinite(s), y, np.nan), s) for name, (y, s) in given.items()}
    known = {name: np.asarray(x, dtype=float) for name, x in (covariates or {}).items()}
    trends = _fit_trends(data, known)
    scatters: list[CoefficientScatter] = []
    for name, (y, s) in data.items():
        found = [t for t in trends if t.coefficient == name and t.significant]
        # Of equally likely ones the first: rounding is no reason.
        best = min(found, key=lambda t: float(f"{t.p_value:.4g}"), default=None)
        if best is not None:
            x = known[best.covariate]
            # A joint whose covariate is not known cannot be judged about the trend.
            y = y - best.slope * (x - np.nanmean(x))
        judged = _estimate_robustly(name, y, s, POLICY.level / max(len(data), 1))
        scatters.append(replace(judged, covariate=None if best is None else best.covariate))
    adjusted = iter(holm([p for scatter in scatters for p in scatter.p_adjusted]).tolist())
    return Population(
        tuple(replace(each, p_adjusted=tuple(next(adjusted) for _ in each.p_adjusted)) for each in scatters),
        trends,
    )


def _estimate_robustly(name: str, y: Array, s: Array, level: float) -> CoefficientScatter:
    """Return how a coefficient scatters, its p-values not yet adjusted; ``level`` is for all joints."""
    here = np.flatnonzero(np.isfinite(y))
    scores, p = np.full(y.size, np.nan), np.full(y.size, np.nan)
    v, e, unknown = y[here], s[here], float("nan")
    if here.size < POLICY.scatter:
        mean, error, tau = float(np.mean(v)) if here.size else unknown, unknown, unknown
        kept = np.ones(here.size, dtype=bool)
    else:
        centre = float(np.median(v))
        first = (v - centre) / np.maximum(np.hypot(median_spread(v - centre, e), e), np.finfo(float).tiny)
        # The median and its deviations know as much of a normal sample as 37 % of it would by mean and variance.
        kept = _compute_two_sided(first, 0.37 * (v.size - 1)) > 2 * float(
            scipy.special.ndtr(-POLICY.significant)
        )
        for _ in range(20):
            mean, error, tau = random_effects(v[kept], e[kept])
            scores[here], p[here] = _judge_outliers(v, e, kept)
            # Whoever the others' distribution does not rule out joins them: rejecting more would make it too narrow.
            joined = p[here] > level / v.size
            if np.array_equal(joined, kept) or joined.sum() < POLICY.scatter - 1:
                break
            kept = joined
    return CoefficientScatter(
        name, mean, error, tau, tuple(scores.tolist()), tuple(p.tolist()), None, int(kept.sum())
    )


def _judge_outliers(v: Array, e: Array, kept: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return z-scores and p-values of joints against those that were kept, each without itself."""
    mean, error, tau = random_effects(v[kept], e[kept])
    # Equal numbers differ by their rounding at most.
    least = 1e-12 * float(np.max(np.abs(v))) + np.finfo(float).tiny
    z = (v - mean) / np.maximum(np.sqrt(tau**2 + e**2 + error**2), least)
    p = _compute_two_sided(z, max(kept.sum() - 2, 1))
    # Beyond so many standard deviations: only these are judged with themselves left out; nearer ones cannot be
    # outliers.
    for i in np.flatnonzero(kept & (np.abs(z) > 2.0)):
        # Its influence on mean and τ would hide it.
        others = kept & (np.arange(v.size) != i)
        m, m_error, m_tau = random_effects(v[others], e[others])
        z[i] = (v[i] - m) / max(float(np.sqrt(m_tau**2 + e[i] ** 2 + m_error**2)), least)
        p[i] = _compute_two_sided(z[i : i + 1], max(others.sum() - 2, 1))[0]
    return z, p


def median_spread(deviation: Array, errors: Array) -> float:
    """Return the τ under which the median of d²/(τ² + s²) is that of χ² of one degree.

    With errors of zero this is 1.4826 times the median absolute deviation.
    """
    squares, variances = deviation**2, errors**2
    return _find_root(lambda t: float(np.median(squares / (t + variances))) - MEDIAN_SQUARE, deviation)


def random_effects(y: Array, s: Array) -> tuple[float, float, float]:
    """Return mean, its standard error and τ, such that Σ (y − μ)²/(τ² + s²) = n − 1 (Paule and Mandel)."""

    def excess(t: float) -> float:
        w = 1 / (t + s**2)
        return float(w @ (y - w @ y / w.sum()) ** 2) - (y.size - 1)

    tau = _find_root(excess, y - np.mean(y))
    # Equal estimates without errors: any equal weights will do.
    variance = np.maximum(tau**2 + s**2, 1e-60)
    w = 1 / variance
    return float(w @ y / w.sum()), float(w.sum() ** -0.5), tau


def _find_root(excess: Callable[[float], float], deviation: Array) -> float:
    """Return the root of the τ² at which a falling function is zero; zero where it is not positive anywhere."""
    top = 4.0 * float(np.max(deviation**2)) * max(deviation.size, 4)
    low = 1e-18 * top
    if top == 0 or excess(low) <= 0:
        return 0.0
    while excess(top) > 0:
        top *= 4
    return float(np.sqrt(scipy.optimize.brentq(excess, low, top, xtol=1e-15 * top, rtol=1e-12)))


def _fit_trends(
    data: Mapping[str, tuple[Array, Array]], covariates: Mapping[str, Array]
) -> tuple[Trend, ...]:
    found = []
    for name, (y, s) in data.items():
        for covariate, x in covariates.items():
            use = np.isfinite(y) & np.isfinite(x)
            if use.sum() < POLICY.scatter + 1 or np.unique(x[use]).size < 3:
                continue
            slope, error, level, degrees = robust_line(x[use], y[use], s[use])
            p = float(_compute_two_sided(np.array([slope / error]), degrees)[0]) if error > 0 else 1.0
            change = slope * float(np.ptp(x[use])) / level if level else float("nan")
            found.append(Trend(name, covariate, slope, error, p, p, change, int(use.sum())))
    adjusted = holm([trend.p_value for trend in found])
    return tuple(replace(trend, p_adjusted=float(p)) for trend, p in zip(found, adjusted, strict=True))


def robust_line(x: Array, y: Array, s: Array) -> tuple[float, float, float, float]:
    """Return slope, its HC3 standard error, level at the mean of x, and degrees, by Huber's weights and 1/(τ² + s²).

    Parameters
    ----------
    x, y, s : ndarray, shape (n,)
        Covariate, estimates, their standard errors.
    """
    design = np.column_stack([np.ones(x.size), x - np.mean(x)])
    residual = y - np.median(y)
    weight, estimate, huber = np.ones(x.size), np.zeros(2), 1.345
    for _ in range(50):
        scale = np.hypot(median_spread(residual - np.median(residual), s), s)
        scale = np.maximum(scale, 1e-12 * np.max(np.abs(y)) + np.finfo(float).tiny)
        z = np.abs(residual) / scale
        weight = np.minimum(1.0, huber / np.maximum(z, huber)) / scale**2
        last = estimate
        bread = np.linalg.inv(design.T @ (weight[:, None] * design))
        estimate = bread @ (design.T @ (weight * y))
        residual = y - design @ estimate
        if np.all(np.abs(estimate - last) <= 1e-10 * (np.abs(estimate) + np.abs(last))):
            break
    leverage = np.einsum("ij,jk,ik,i->i", design, bread, design, weight)
    # The slope of Huber's function gives how the estimate moves: one within its bend, none beyond.
    within = np.where(np.abs(residual) <= huber * scale, 1 / scale**2, 0.0)
    bread = np.linalg.pinv(design.T @ (within[:, None] * design))
    pull = design * (weight * residual / np.maximum(1 - leverage, 1e-3))[:, None]
    covariance = bread @ (pull.T @ pull) @ bread
    return (
        float(estimate[1]),
        float(np.sqrt(covariance[1, 1])),
        float(estimate[0]),
        _estimate_degrees(design, bread, weight, leverage),
    )


def _estimate_degrees(design: Array, bread: Array, weight: Array, leverage: Array) -> float:
    """Return Satterthwaite's degrees of freedom of the slope's HC3 variance (Bell and McCaffrey 2002)."""
    n = design.shape[0]
    # Beyond so many joints the degrees of freedom of a slope's error do not matter.
    if n > 400:
        return n - 2.0
    root = np.sqrt(weight)
    scaled = root[:, None] * design
    away = np.eye(n) - scaled @ np.linalg.solve(scaled.T @ scaled, scaled.T)
    pull = (bread[1] @ design.T) * root / np.maximum(1 - leverage, 1e-3)
    moved = pull[:, None] * away
    spectrum = moved.T @ moved
    return float(np.trace(spectrum) ** 2 / np.sum(spectrum**2))


def holm(p: ArrayLike) -> Array:
    """Return p-values adjusted for being several, by Holm's steps; NaN stays and does not count.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.5]).tolist()
    [0.03, 0.08, 0.5]
    """
    values = np.asarray(p, dtype=float)
    adjusted = values.copy()
    here = np.flatnonzero(np.isfinite(values))
    order = here[np.argsort(values[here])]
    steps = values[order] * np.arange(order.size, 0, -1)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(steps))
    return adjusted


def _compute_two_sided(z: Array, degrees: float) -> Array:
    return np.asarray(2 * scipy.special.stdtr(degrees, -np.abs(z)), dtype=float)
