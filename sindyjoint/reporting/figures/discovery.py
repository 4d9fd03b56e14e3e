"""The figures of a discovery."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.figures import evidence, inputs, loops, maps, residuals
from sindyjoint.reporting.figures.kind import Kind, Panel, by_name, fixed, spread


def _loops(data: ReportData) -> list[Panel]:
    groups = spread(list(loops.loop_groups(data)))
    return [partial(loops.loops, group=group) for group in groups]


def _residual(data: ReportData) -> list[Panel]:
    periodic = any(loop.residual_over_phase.size for loop in data.loops)
    phase: list[Panel] = [residuals.residual_phase] if periodic else []
    return [maps.map_residual, *phase, residuals.residual_time]


def _coefficients(data: ReportData) -> list[Panel]:
    return [partial(evidence.coefficient, term=term) for term in evidence.drawn_coefficients(data)]


def _inputs(data: ReportData) -> list[Panel]:
    laws: list[Panel] = [partial(inputs.law_at_values, over=over) for over in data.over if data.model.terms]
    return laws + [
        partial(inputs.coefficient_over, over=over, row=row) for over, row in inputs.drawn_over(data)
    ]


def _with_terms(*panels: Panel) -> Callable[[ReportData], list[Panel]]:
    return lambda data: list(panels) if data.model.terms else []


def _fit(data: ReportData) -> list[Panel]:
    # The middle of the frequencies: neither the slowest nor the one that is hardest to follow.
    groups = list(loops.loop_groups(data))
    return [partial(loops.loops, group=groups[len(groups) // 2])]


_WHOLE = (
    Kind(
        "fit",
        "Model over measurement",
        "Transfer moment over angle of the runs at one frequency; black dots are the model where the joint moves.",
        _fit,
    ),
    Kind(
        "map",
        "Force–state map",
        "Transfer moment averaged over cells of angle and rate, samples per cell, and cuts through the map: at "
        "zero rate the friction shows as a step, at the middle angle as a jump of the line.",
        fixed(maps.map_moment, maps.map_counts, maps.cut_at_zero_rate, maps.cut_at_centre),
    ),
    Kind(
        "loops",
        "Moment–angle loops",
        "One period of each run, transfer moment over angle; black dots are the model where the joint moves.",
        _loops,
    ),
    Kind(
        "residual",
        "Residual",
        "Residual over angle and rate, over the phase of the cycle, and over time. Structure that stands above the "
        "noise floor is an effect that the model lacks.",
        _residual,
    ),
    Kind(
        "path",
        "Choice of the terms",
        "Fit residual and held-out error over the number of terms, and the number of terms over the threshold.",
        fixed(evidence.path, evidence.threshold),
    ),
    Kind(
        "coefficients",
        "Coefficients by frequency, or by part of the record",
        "The chosen terms fitted to each single frequency (or part), with 95 % intervals, the bias of the "
        "processing taken out where it is known. Line: all together. Grey: ±10 %. Crosses: the paper's "
        "tables, where the joint is one of the paper's.",
        _coefficients,
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
        _with_terms(evidence.covariance),
    ),
)

_PARTS: dict[str, tuple[str, Panel]] = {
    "map-moment": (
        "Averaged transfer moment over angle and rate, with the model's contours.",
        maps.map_moment,
    ),
    "map-counts": ("Moving samples in every cell of the force–state map.", maps.map_counts),
    "map-rest": (
        "Cut through the force–state map at zero rate, with the friction step.",
        maps.cut_at_zero_rate,
    ),
    "map-centre": ("Cut through the force–state map at the middle angle.", maps.cut_at_centre),
    "residual-map": ("Mean residual over angle and rate.", maps.map_residual),
    "residual-phase": ("Mean residual over the phase of the cycle.", residuals.residual_phase),
    "residual-time": ("RMS residual over time.", residuals.residual_time),
    "path-error": ("Fit residual and held-out error over the number of terms.", evidence.path),
    "path-threshold": ("Number of terms over the threshold.", evidence.threshold),
}

KINDS = {
    **by_name(*_WHOLE),
    **{
        name: Kind(name, name.replace("-", ", "), caption, fixed(panel), part=True)
        for name, (caption, panel) in _PARTS.items()
    },
}
