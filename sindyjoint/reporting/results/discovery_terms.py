"""Pictures of why these terms, coefficients by frequency and over inputs; all figures of a discovery."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.equation.model import JointModel
from sindyjoint.judgement.comparison import Comparison
from sindyjoint.judgement.over_inputs import CoefficientOver, OverInput
from sindyjoint.paper import FREQUENCIES, TABLES, TERMS
from sindyjoint.reporting.figure import (
    Curve,
    Kind,
    Panel,
    Scale,
    angle_scale,
    by_name,
    colour_scale,
    cycled,
    fixed,
    math_symbol,
    moment_scale,
    nothing,
    plot,
    scale_of,
    spread,
    written_cells,
)
from sindyjoint.reporting.results.discovery_data import ReportData
from sindyjoint.reporting.results.discovery_states import (
    NOISE_FLOOR,
    cut_at_centre,
    cut_at_zero_rate,
    loop_groups,
    loops,
    map_counts,
    map_moment,
    map_residual,
    residual_phase,
    residual_time,
)
from sindyjoint.reporting.style import (
    ACCENT,
    DIVERGING,
    FIXED_INK,
    FIXED_PAPER,
    INK,
    PALETTE,
    RULE,
    Axes,
    plain,
    pretty_unit,
)
from sindyjoint.text import in_words_of, spelled

# A parameter counts as the same at two frequencies when it differs by less than this.
EQUIVALENCE = 0.10


def path(data: ReportData, ax: Axes) -> None:
    """Draw the residual and the held-out error over the number of terms kept, and the chosen model."""
    from matplotlib.ticker import MaxNLocator, NullLocator

    if not data.path:
        return nothing(ax, data.selection_reason)
    size = [len(step.terms) for step in data.path]
    fitted, held_out = (
        np.array([getattr(step, n) for step in data.path]) for n in ("residual_rms", "held_out_rms")
    )
    left_out = {"color": PALETTE[1], "marker": "s", "ms": 3, "ls": "--", "label": "held-out error"}
    curves: list[Curve] = [
        (size, fitted, {"color": PALETTE[0], "marker": "o", "ms": 3, "label": "residual of the fit"}),
        *[(size, held_out, left_out)] * bool(np.isfinite(held_out).any()),
        (None, data.model.fitted.noise_floor or None, NOISE_FLOOR),
        (None if data.chosen is None else size[data.chosen], None, {"color": INK, "lw": 0.8, "ls": ":"}),
    ]
    up = moment_scale(data.model.joint.motion, fitted, "RMS")
    title = f"Path of models{_chosen_note(data, 'dotted')}"
    plot(ax, "Terms kept", up, curves, title, legend="best", yscale="log")
    ax.yaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def threshold(data: ReportData, ax: Axes) -> None:
    """Draw how many terms survive a threshold on the unique share."""
    from matplotlib.ticker import LogLocator, NullLocator

    if not data.path:
        return nothing(ax, data.selection_reason)
    # A model stands for every threshold up to its weakest term; larger models with weaker terms come first.
    limit = np.maximum.accumulate([max(step.threshold, 1e-9) for step in data.path])
    edges = [limit[0] / 3, *limit]
    ax.stairs([len(step.terms) for step in data.path], edges, baseline=None, color=PALETTE[0], linewidth=1.2)
    if data.chosen is not None:
        ax.axvspan(*edges[data.chosen : data.chosen + 2], color=PALETTE[4], alpha=0.25, linewidth=0)
    ax.set(
        xscale="log", xlabel="Threshold (unique share of the RMS)", ylabel="Terms kept",
        title=f"Terms over the threshold{_chosen_note(data, 'shaded')}",
    )  # fmt: skip
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_locator(LogLocator(numticks=7))


def _chosen_note(data: ReportData, mark: str) -> str:
    return "" if data.chosen is None else f" ({mark}: the chosen {len(data.path[data.chosen].terms)})"


def coefficient(data: ReportData, ax: Axes, term: str) -> None:
    """Draw one coefficient for each single frequency, with 95 % intervals, a ±10 % band and the paper's values."""
    index, groups = data.model.ids.index(term), data.groups
    item = data.model.terms[index]
    values, errors = np.array([(g.coefficients[index], g.standard_errors[index]) for g in groups]).T
    published = paper_values(data.model.joint.name, item.id)
    shown = [(i + 0.18, published[g.group]) for i, g in enumerate(groups) if g.group in published]
    factor, unit = scale_of(item.coefficient, item.unit)
    _estimates(
        ax, ("", Scale(math_symbol(item.symbol), unit, factor)), (np.arange(len(groups)), values, errors),
        (item.coefficient, EQUIVALENCE), shown, xticks=range(len(groups)),
        xticklabels=[plain(group.group) for group in groups], xlim=(-0.6, len(groups) - 0.4),
    )  # fmt: skip
    if len(groups) > 6:
        ax.tick_params(axis="x", rotation=60)
    ax.set_title(plain(in_words_of(data.model.joint.motion, item.name)))


def dependence(result: Comparison, ax: Axes, test: FrequencyTest) -> None:
    """Draw a coefficient by frequency, with 95 % intervals, the margin of equivalence and the answer of its tests."""
    frequencies = np.array(test.frequencies)
    published, aside = paper_values(result.joint, test.name), 0.03 * float(np.ptp(frequencies))
    shown = [(f + aside, published[at]) for f in frequencies if (at := f"{f:.4g} Hz") in published]
    estimates = frequencies, np.array(test.estimates), np.array(test.standard_errors)
    factor, unit = scale_of(test.mean, result.units.get(test.name, ""))
    _estimates(
        ax, ("Frequency (Hz)", Scale(unit, "", factor)), estimates, (test.mean, test.margin), shown, xmargin=0.12
    )  # fmt: skip
    ax.set_title(plain(f"{spelled(test.name, result.motion)}\n{test.answer}"))


def _estimates(
    ax: Axes,
    axes: tuple[str, Scale],
    estimates: tuple[Any, Any, Any],
    band: tuple[float, float],
    published: Sequence[tuple[float, float]],
    **settings: Any,
) -> None:
    """Draw values with 95 % intervals over a centre and its relative margin, with crosses.

    The band is shown whole, and points outside it, with some room; never an interval that leaves the page.
    """
    (x, values, errors), (centre, margin) = estimates, band
    crosses = np.array(published).reshape(-1, 2).T
    ends = 1 + 1.5 * EQUIVALENCE * np.array([-1, 1])
    reach = np.concatenate([centre * ends, crosses[1], values - 2.2 * errors, values + 2.2 * errors])
    reach = axes[1].factor * reach[np.abs(reach) < 10 * abs(centre) + 1e-300]
    room = 0.06 * np.ptp(reach)
    curves = [
        (None, (centre * (1 - margin), centre * (1 + margin)), {"color": RULE, "alpha": 0.6, "lw": 0}),
        (None, centre, {"color": INK, "lw": 0.8}),
        (x, values, {"yerr": 1.96 * errors, "fmt": "o", "ms": 3.5, "capsize": 2.5, "color": PALETTE[0]}),
        *[(*crosses, {"ls": "none", "marker": "x", "ms": 4, "color": ACCENT})] * bool(published),
    ]
    plot(ax, *axes, curves, ylim=(reach.min() - room, reach.max() + room) if room else None, **settings)


def paper_values(joint: str, term: str) -> dict[str, float]:
    """Return what the paper's table says of a term, by frequency; nothing for a joint or a term that is not in it.

    Examples
    --------
    >>> paper_values("inter-panel joint", "linear_damping")["4 Hz"]
    49.0
    >>> paper_values("other hinge", "linear_damping")
    {}
    """
    for table in TABLES:
        if table.joint == joint.strip().lower() and term in TERMS:
            return {f"{f:.4g} Hz": value for f, value in zip(FREQUENCIES, table.column(term), strict=True)}
    return {}


def covariance(data: ReportData, ax: Axes) -> None:
    """Draw the correlation of the coefficients' errors."""
    model = data.model
    matrix = correlation(model)
    names = [math_symbol(term.symbol) for term in model.terms]
    words = np.vectorize("{:.2f}".format)(matrix) if len(names) <= 9 else ()
    mesh = written_cells(
        ax, matrix, words, np.where(np.abs(matrix) > 0.6, FIXED_PAPER, FIXED_INK), (names, names),
        cmap=DIVERGING, vmin=-1, vmax=1,
    )  # fmt: skip
    colour_scale(ax, mesh, "correlation")
    ax.set_title("Correlation of the coefficients' errors")


def correlation(model: JointModel) -> Any:
    """Return the correlation matrix of a model's coefficients, shape (k, k); the diagonal is one."""
    matrix = np.array(model.covariance, dtype=float).reshape(len(model.terms), len(model.terms))
    size = np.sqrt(np.diag(matrix))
    size[size == 0] = 1.0
    scaled = matrix / np.outer(size, size)
    np.fill_diagonal(scaled, 1.0)
    return scaled


def _law_at(data: ReportData, over: OverInput, value: float) -> JointModel:
    """Return the law at a value of an input, in the unit of its table."""
    given = next(known for known in data.model.inputs if known.name == over.name)
    return data.model.at(**{over.name: given.zero + given.factor * value})


def law_at_values(data: ReportData, ax: Axes, over: OverInput) -> None:
    """Draw one cycle of the law, through the largest tested angle and rate, at the values of its table."""
    fitted, motion = data.model.fitted, data.model.joint.motion
    phase = np.linspace(0, 2 * np.pi, 401)
    angle, rate = fitted.angle * np.sin(phase), fitted.rate * np.cos(phase)
    moments = [_law_at(data, over, value).moment(angle, rate) for value in over.values]
    x, y = angle_scale(motion, fitted.angle), moment_scale(motion, moments)
    curves = [
        (angle, moment, cycled(place, label=pretty_unit(heading)))
        for place, (moment, heading) in enumerate(zip(moments, over.headings, strict=False))
    ]
    plot(ax, x, y, curves, legend="none")
    ax.set_title(plain(f"the law over {over.label}\none cycle to the largest {x.name.lower()}"))
    ax.set_ylim(top=1.5 * y.factor * float(np.max(moments)))
    ax.legend(
        loc="upper center", ncols=len(moments), frameon=False, columnspacing=0.8, handlelength=1.4, handletextpad=0.4
    )  # fmt: skip


def coefficient_over(data: ReportData, ax: Axes, over: OverInput, row: CoefficientOver) -> None:
    """Draw a coefficient of the law over an input, with its 95 % interval, and the fits to single levels."""
    shown = np.linspace(over.values[0], over.values[-1], 13)
    laws = [_law_at(data, over, float(value)) for value in shown]
    values, errors = np.array(
        [(law[row.id].coefficient, law[row.id].standard_error) if row.id in law else (0, 0) for law in laws]
    ).T
    factor, unit = scale_of(float(np.abs(values).max()), row.unit)
    bars = {
        "yerr": 1.96 * np.array(row.level_errors), "fmt": "o", "ms": 3.5, "capsize": 2.5, "color": PALETTE[1]
    }  # fmt: skip
    curves: list[Curve] = [
        (
            shown,
            (values - 1.96 * errors, values + 1.96 * errors),
            {"color": PALETTE[0], "alpha": 0.25, "lw": 0},
        ),
        (shown, values, {"color": PALETTE[0]}),
        *[(row.levels, np.array(row.estimates), bars)] * bool(row.levels),
    ]
    axes = Scale(plain(over.label), pretty_unit(over.unit)), Scale(math_symbol(row.symbol), unit, factor)
    plot(ax, *axes, curves, xmargin=0.06, ymargin=0.15)
    ax.set_title(plain(f"{data.model[row.id].name}" + (f"\n{over.dependence(row)}" if row.answer else "")))


def _inputs(data: ReportData) -> list[Panel]:
    # A coefficient that has something to show over an input.
    told = [
        partial(coefficient_over, over=over, row=row)
        for over in data.over
        for row in over.coefficients
        if row.levels or len(set(row.values)) > 1
    ]
    return [*(partial(law_at_values, over=over) for over in data.over if data.model.terms), *spread(told)]


_WHOLE = (
    Kind(
        "fit",
        "Model over measurement",
        "Transfer moment over angle of the runs at one frequency; the dots are the model where the joint moves.",
        # The middle of the frequencies: neither the slowest nor the one that is hardest to follow.
        lambda data: [partial(loops, group=[*loop_groups(data)][len(loop_groups(data)) // 2])],
    ),
    Kind(
        "map",
        "Force–state map",
        "Transfer moment averaged over cells of angle and rate, samples per cell, and cuts through the map: at "
        "zero rate the friction shows as a step, at the middle angle as a jump of the line.",
        fixed(map_moment, map_counts, cut_at_zero_rate, cut_at_centre),
    ),
    Kind(
        "loops",
        "Moment–angle loops",
        "One period of each run, transfer moment over angle; the dots are the model where the joint moves.",
        lambda data: [partial(loops, group=group) for group in spread(list(loop_groups(data)))],
    ),
    Kind(
        "residual",
        "Residual",
        "Residual over angle and rate, over the phase of the cycle, and over time. Structure that stands above the "
        "noise floor is an effect that the model lacks.",
        lambda data: [
            map_residual,
            *[residual_phase] * any(loop.residual_over_phase.size for loop in data.loops),
            residual_time,
        ],
    ),
    Kind(
        "path",
        "Choice of the terms",
        "Fit residual and held-out error over the number of terms, and the number of terms over the threshold.",
        fixed(path, threshold),
    ),
    Kind(
        "coefficients",
        "Coefficients by frequency, or by part of the record",
        "The chosen terms fitted to each single frequency (or part), with 95 % intervals. Line: all "
        "together.{crosses} Grey: ±10 %.",
        lambda data: [partial(coefficient, term=term) for term in data.model.ids if data.groups],
    ),
    Kind(
        "inputs",
        "Coefficients over the inputs",
        "The law at the values of the table, and each coefficient that depends on an input or was tested for it: the "
        "line is the law with its 95 % interval, points are fits to the runs of a single level.",
        _inputs,
    ),
    Kind(
        "covariance",
        "Covariance",
        "Correlation of the coefficients' errors; near ±1 the data cannot distinguish two terms.",
        fixed(covariance, when=lambda data: data.model.terms),
    ),
)

_PARTS: dict[str, tuple[str, Panel]] = {
    "map-moment": ("Averaged transfer moment over angle and rate, with the model's contours.", map_moment),
    "map-counts": ("Moving samples in every cell of the force–state map.", map_counts),
    "map-rest": ("Cut through the force–state map at zero rate, with the friction step.", cut_at_zero_rate),
    "map-centre": ("Cut through the force–state map at the middle angle.", cut_at_centre),
    "residual-map": ("Mean residual over angle and rate.", map_residual),
    "residual-phase": ("Mean residual over the phase of the cycle.", residual_phase),
    "residual-time": ("RMS residual over time.", residual_time),
    "path-error": ("Fit residual and held-out error over the number of terms.", path),
    "path-threshold": ("Number of terms over the threshold.", threshold),
}

KINDS = {
    **by_name(*_WHOLE),
    **{
        name: Kind(name, name.replace("-", ", "), caption, fixed(panel), part=True)
        for name, (caption, panel) in _PARTS.items()
    },
}
