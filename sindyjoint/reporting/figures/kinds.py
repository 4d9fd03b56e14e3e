"""The kinds of figure by name, and the panels that each is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from matplotlib.axes import Axes

from sindyjoint.batch.summary import Batch
from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.diagnosis.structure.result import StructureDiagnosis
from sindyjoint.reporting import (
    batch_figures,
    comparison,
    diagnosis,
    structure,
    verification,
)
from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.figures import before_after, evidence, loops, maps, residuals
from sindyjoint.reporting.figures.kind import Kind, Panel, fixed
from sindyjoint.reporting.figures.places import where
from sindyjoint.reporting.figures.rig_kinds import REPRODUCTION, RIG
from sindyjoint.reporting.reproduction_figures import ReproductionFigures
from sindyjoint.reporting.rig_motion import RigFigures
from sindyjoint.reporting.style import plain, shortened
from sindyjoint.reporting.units import in_words_of
from sindyjoint.response.verification import Verification
from sindyjoint.workflows.comparison import Comparison

MOST_PANELS = 6


def _loops(data: ReportData) -> list[Panel]:
    groups = loops.spread(list(loops.loop_groups(data)), MOST_PANELS)
    return [partial(loops.loops, group=group) for group in groups]


def _residual(data: ReportData) -> list[Panel]:
    periodic = any(loop.residual_over_phase.size for loop in data.loops)
    phase: list[Panel] = [residuals.residual_phase] if periodic else []
    return [maps.map_residual, *phase, residuals.residual_time]


def _coefficients(data: ReportData) -> list[Panel]:
    return [partial(evidence.coefficient, term=term) for term in evidence.drawn_coefficients(data)]


def _with_terms(*panels: Panel) -> Callable[[ReportData], list[Panel]]:
    return lambda data: list(panels) if data.model.terms else []


_WHOLE = (
    Kind(
        "map",
        "Force–state map",
        "Transfer moment averaged over cells of angle and rate, samples per cell, and cuts through the map: at "
        "zero rate the friction shows as a step, at the middle angle as a jump of the line.",
        fixed(maps.map_moment, maps.map_counts, maps.cut_at_rest, maps.cut_at_centre),
    ),
    Kind(
        "loops",
        "Moment–angle loops",
        "One period of each run, transfer moment over angle; black dots are the model where the joint moves.",
        _loops,
    ),
    Kind(
        "residual",
        "What the model leaves",
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
        "The chosen terms fitted to each frequency (or part) alone, with 95 % intervals, the bias of the "
        "processing taken out where it is known. Line: all together. Grey: ±10 %. Crosses: the paper's "
        "tables, where the joint is one of the paper's.",
        _coefficients,
    ),
    Kind(
        "covariance",
        "Covariance",
        "Correlation of the coefficients' errors; near ±1 the data cannot tell two terms apart.",
        _with_terms(evidence.covariance),
    ),
)

_PARTS: dict[str, tuple[str, Panel]] = {
    "map-moment": (
        "Averaged transfer moment over angle and rate, with the model's contours.",
        maps.map_moment,
    ),
    "map-counts": ("Moving samples in every cell of the force–state map.", maps.map_counts),
    "map-rest": ("Cut through the force–state map at zero rate, with the friction step.", maps.cut_at_rest),
    "map-centre": ("Cut through the force–state map at the middle angle.", maps.cut_at_centre),
    "residual-map": ("Mean residual over angle and rate.", maps.map_residual),
    "residual-phase": ("Mean residual over the phase of the cycle.", residuals.residual_phase),
    "residual-time": ("RMS residual over time.", residuals.residual_time),
    "path-error": ("Fit residual and held-out error over the number of terms.", evidence.path),
    "path-threshold": ("Number of terms over the threshold.", evidence.threshold),
}

DISCOVERY: dict[str, Kind] = {
    **{kind.name: kind for kind in _WHOLE},
    **{
        name: Kind(name, name.replace("-", ", "), caption, fixed(panel), part=True)
        for name, (caption, panel) in _PARTS.items()
    },
}


def _of_runs(draw: Callable[[Any, Axes], Axes], has: Callable[[Any], bool]) -> Callable[[Any], list[Panel]]:
    """Return panels that draw one run each."""

    def panels(result: Any) -> list[Panel]:
        shown = loops.spread([run for run in result.runs if has(run)], MOST_PANELS)
        return [partial(_of_run, draw=draw, run=run, named=len(result.runs) > 1) for run in shown]

    return panels


def _of_run(result: Any, ax: Axes, draw: Callable[[Any, Axes], Axes], run: Any, named: bool) -> Axes:
    draw(run, ax)
    if named:
        ax.set_title(plain(shortened(run.name)))
    return ax


VERIFICATION: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "response",
            "Response",
            "Measured and simulated response over time, with the band that the uncertainty of the coefficients allows.",
            _of_runs(verification.response, lambda run: True),
            wide=True,
        ),
        Kind(
            "cycles",
            "First cycles",
            "The first cycles of the measured and the simulated response.",
            _of_runs(partial(verification.response, zoom=True), lambda run: True),
        ),
        Kind(
            "envelope",
            "Envelope",
            "Amplitude of every swing, measured and simulated, with the envelope by Hilbert's transform.",
            _of_runs(verification.amplitude, lambda run: any(run.oscillations)),
        ),
        Kind(
            "period",
            "Period",
            "Period of every cycle, measured and simulated.",
            _of_runs(verification.period, lambda run: any(run.oscillations)),
        ),
        Kind(
            "error",
            "Error",
            "Simulated less measured response over time.",
            _of_runs(verification.error, lambda run: run.simulated is not None),
            wide=True,
        ),
        Kind(
            "energy",
            "Energy",
            "Energy dissipated in every cycle, measured and simulated.",
            _of_runs(verification.energy, lambda run: run.energy is not None),
        ),
    )
}

DIAGNOSIS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "gap",
            "Gap by step",
            "Gap between model and measurement before and after each named effect, beside the noise floor.",
            fixed(diagnosis.gap_by_step),
            wide=True,
        ),
        Kind(
            "maps",
            "Maps before and after",
            "Mean of measured less model over cells of angle and rate, with the model alone and with the effects, in "
            "the same colours.",
            before_after.maps,
        ),
        Kind(
            "overlay",
            "Runs before and after",
            "Some runs beside the model alone and with the effects, and what either leaves of them beside the noise. "
            "Coefficients are those of the fit to all runs.",
            before_after.overlays,
        ),
        Kind(
            "where",
            "Where the gap lies",
            "Regions of the motion that hold more of the first gap than their share of the samples.",
            lambda result: [where] if result.where else [],
            wide=True,
        ),
        Kind(
            "budget",
            "Budget of the gap",
            "What the first gap is made of: a function of the state, memory, differences between runs, processing, "
            "noise.",
            fixed(diagnosis.budget_parts),
            wide=True,
        ),
        Kind(
            "rivals",
            "Rivals",
            "Probability of each named effect, and of the effects that would explain nearly as much.",
            lambda result: [diagnosis.rivals] if result.steps else [],
            wide=True,
            height=diagnosis.rivals_height,
        ),
    )
}


def _of_records(draw: Callable[[Any, Axes], Axes]) -> Callable[[Any], list[Panel]]:
    """Return panels that draw one record each."""

    def panels(result: Any) -> list[Panel]:
        return [partial(_of_record, draw=draw, record=record) for record in result.records[:MOST_PANELS]]

    return panels


def _of_record(result: Any, ax: Axes, draw: Callable[[Any, Axes], Axes], record: Any) -> Axes:
    return draw(record, ax)


STRUCTURE: dict[str, Kind] = DIAGNOSIS | {
    kind.name: kind
    for kind in (
        Kind(
            "gap",
            "Gap by step",
            "Response gap before and after each named effect, down to the noise floor; the scale is logarithmic.",
            fixed(structure.gap_by_step),
            wide=True,
        ),
        Kind(
            "overlay",
            "Before and after",
            "Measured displacement, and what the simulations miss of it: with the model alone and with the effects. "
            "What lies behind the line was kept out of the fit that is drawn.",
            _of_records(structure.overlay),
            wide=True,
        ),
        Kind(
            "cycles",
            "A few cycles",
            "Some cycles of what was kept out of the fit, measured and simulated.",
            _of_records(structure.cycles),
            wide=True,
        ),
        Kind(
            "envelope",
            "Envelope",
            "Envelope of the measured and the simulated displacement, beside the noise.",
            _of_records(structure.envelope),
            wide=True,
        ),
        Kind(
            "budget",
            "Budget of the gap",
            "What the first gap is made of: memoryless effects of the joint and its coefficients (state), memory in "
            "the joint (history), what lies outside the joint or is not explained (run), the time step (processing), "
            "noise.",
            fixed(diagnosis.budget_parts),
            wide=True,
        ),
    )
}

COMPARISON: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "inclusion",
            "Inclusion map",
            comparison.MAP_CAPTION,
            fixed(comparison.inclusion),
            wide=True,
            height=comparison.inclusion_height,
        ),
        Kind(
            "dependence",
            "Coefficients by frequency",
            "Each coefficient at each frequency alone with its 95 % interval; line and grey band: their mean and the "
            "margin within which they count as the same. Crosses: the paper's tables, where the joint is one of its "
            "own.",
            lambda result: [partial(evidence.dependence, test=test) for test in result.tests],
        ),
    )
}


BATCH: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "joints",
            "Coefficients of every joint",
            "The common terms of every joint with 95 % intervals. Line: their mean; grey: where 95 % of joints lie. "
            "Diamonds: joints that stand out.",
            lambda result: [partial(batch_figures.joints, term=term) for term in result.common[:MOST_PANELS]],
        ),
        Kind(
            "trends",
            "Trends",
            "Coefficients over what the manifests declare, where a trend stands at 5 % over all that was looked for. "
            "Line: the robust fit, with the 95 % interval of its slope.",
            lambda result: [
                partial(batch_figures.trend, trend=trend)
                for trend in [t for t in result.population.trends if t.significant][:MOST_PANELS]
            ],
        ),
    )
}


OTHERS = (Verification, Diagnosis, Comparison, Batch, ReproductionFigures, RigFigures)


def kinds_of(result: Any) -> dict[str, Kind]:
    """Return the kinds of figure that belong to a result, in the words of its kind of motion."""
    kinds = _kinds(result)
    joint = getattr(getattr(result, "model", None), "joint", None)
    if joint is None or joint.motion == "rotation":
        return kinds
    return {
        name: replace(
            kind, title=in_words_of(joint.motion, kind.title), caption=in_words_of(joint.motion, kind.caption)
        )
        for name, kind in kinds.items()
    }


def _kinds(result: Any) -> dict[str, Kind]:
    if isinstance(result, Verification):
        return VERIFICATION
    if isinstance(result, StructureDiagnosis):
        return STRUCTURE
    if isinstance(result, Diagnosis):
        return DIAGNOSIS
    if isinstance(result, Batch):
        return BATCH
    if isinstance(result, ReproductionFigures):
        return REPRODUCTION
    if isinstance(result, RigFigures):
        return RIG
    return COMPARISON if isinstance(result, Comparison) else DISCOVERY
