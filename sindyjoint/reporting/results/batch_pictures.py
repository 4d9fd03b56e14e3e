"""Coefficients of every joint of a batch, and trends over what the manifests declare."""

from __future__ import annotations

from functools import partial

import numpy as np

from sindyjoint.reporting.figure import MOST_PANELS, Axes, Kind, by_name
from sindyjoint.reporting.style import (
    ACCENT,
    INK,
    MUTED,
    PALETTE,
    RULE,
    plain,
    prefixed,
    pretty_unit,
    shortened,
)
from sindyjoint.text import spelled
from sindyjoint.workflows.joints.population import CoefficientScatter, Trend
from sindyjoint.workflows.joints.summary import TEMPERATURE, Batch

# More names than these cannot be read below an axis.
NAMED = 24
KELVIN = 273.15
NORMAL95 = 1.96


def draw_joints(result: Batch, ax: Axes, term: str) -> Axes:
    """Draw one coefficient of every joint."""
    (scatter,) = (s for s in result.population.scatters if s.coefficient == term)
    values, errors = result.values[term], result.errors[term]
    factor, unit = _scale(values, result.units[term])
    x = np.arange(values.size)
    _distribution(ax, scatter, factor)
    ids = [record.id for record in result.records]
    for i in _points(ax, x, factor * values, factor * errors, scatter, np.isfinite(values)):
        # Towards the middle, so that it stays on the paper.
        right = x[i] < 0.6 * values.size
        ax.annotate(
            plain(shortened(ids[i], 18)), (x[i], factor * values[i]), xytext=(5 if right else -5, 2),
            textcoords="offset points", ha="left" if right else "right", color=ACCENT, fontsize=7,
        )  # fmt: skip
    if len(ids) <= NAMED:
        ax.set_xticks(x, [plain(shortened(name, 14)) for name in ids], rotation=90)
    else:
        ax.set_xlabel("campaign, in the order of the table")
    ax.set(xlim=(-0.7, values.size - 0.3), title=spelled(term, result.motion), ylabel=unit)
    return ax


def _points(
    ax: Axes,
    x: np.ndarray,
    values: np.ndarray,
    errors: np.ndarray,
    scatter: CoefficientScatter,
    use: np.ndarray,
) -> np.ndarray:
    """Draw values with 95 % intervals, the outliers in another colour; return the indices of the outliers."""
    out = np.zeros(values.size, dtype=bool)
    out[list(scatter.outliers)] = True
    for keep, colour, marker in ((use & ~out, PALETTE[0], "o"), (use & out, ACCENT, "D")):
        if keep.any():
            ax.errorbar(x[keep], values[keep], yerr=NORMAL95 * errors[keep], fmt=marker, color=colour,
                        markersize=3.5, elinewidth=0.9)  # fmt: skip
    return np.flatnonzero(use & out)


def _distribution(ax: Axes, scatter: CoefficientScatter, factor: float) -> None:
    if np.isfinite(scatter.mean):
        ax.axhline(factor * scatter.mean, color=INK, linewidth=0.9)
    if np.isfinite(scatter.spread) and scatter.covariate is None:
        half = NORMAL95 * np.hypot(scatter.spread, scatter.mean_error)
        ax.axhspan(factor * (scatter.mean - half), factor * (scatter.mean + half), color=RULE, linewidth=0)


def draw_trend(result: Batch, ax: Axes, trend: Trend) -> Axes:
    """Draw one coefficient over a covariate with its line."""
    term = trend.coefficient
    values, errors, x = result.values[term], result.errors[term], result.covariates[trend.covariate]
    factor, unit = _scale(values, result.units[term])
    (scatter,) = (s for s in result.population.scatters if s.coefficient == term)
    use = np.isfinite(values) & np.isfinite(x)
    of = result.covariate_units.get(trend.covariate, "")
    shift = KELVIN if trend.covariate == TEMPERATURE and of == "K" else 0.0
    _points(ax, x - shift, factor * values, factor * errors, scatter, use)
    centre = float(np.mean(x[use]))
    level = float(np.median(values[use] - trend.slope * (x[use] - centre)))
    line = np.linspace(x[use].min(), x[use].max(), 101)
    middle = level + trend.slope * (line - centre)
    half = NORMAL95 * trend.slope_error * np.abs(line - centre)
    ax.fill_between(line - shift, factor * (middle - half), factor * (middle + half), color=RULE, linewidth=0)
    ax.plot(line - shift, factor * middle, color=INK, linewidth=1.0)
    unit_of = f" ({'°C' if shift else pretty_unit(of)})" if of else ""
    ax.set(xlabel=plain(trend.covariate + unit_of), ylabel=f"{spelled(term, result.motion)} ({unit})")
    ax.set_title(
        f"{100 * trend.change:+.1f} % over the range, p = {trend.p_adjusted:.2g}".replace("-", "−"),
        color=MUTED,
    )
    return ax


def _scale(values: np.ndarray, unit: str) -> tuple[float, str]:
    here = np.abs(values[np.isfinite(values)])
    return prefixed(float(here.max()) if here.size else 1.0, unit)


DIAMONDS = " Diamonds: joints that stand out."

KINDS = by_name(
    Kind(
        "joints",
        "Coefficients of every joint",
        "The common terms of every joint with 95 % intervals. Line: their mean; grey: where 95 % of joints lie."
        + DIAMONDS,
        lambda result: [partial(draw_joints, term=term) for term in result.common[:MOST_PANELS]],
    ),
    Kind(
        "trends",
        "Trends",
        "Coefficients over what the manifests declare, where a trend stands at 5 % over all that was looked for. "
        "Line: the robust fit, with the 95 % interval of its slope.",
        lambda result: [
            partial(draw_trend, trend=trend)
            for trend in [t for t in result.population.trends if t.significant][:MOST_PANELS]
        ],
    ),
)
