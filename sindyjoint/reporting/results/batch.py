"""A batch: all joints in one table, what stands out and the trends, on a terminal, as pictures, as a page, as files."""

import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from sindyjoint.policy import SHARED as POLICY
from sindyjoint.reporting.equation import estimate, signed_percent, with_unit
from sindyjoint.reporting.figure import MOST_PANELS, Curve, Kind, Scale, by_name, plot, scaled
from sindyjoint.reporting.page import Blocks, Page, markup, section, sentence
from sindyjoint.reporting.style import ACCENT, INK, MUTED, PALETTE, RULE, Axes, plain, pretty_unit, shortened
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    csv_records,
    escape,
    fitting_blocks,
    tabulate,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.text import list_some, percent, spelled
from sindyjoint.trust import Light, Trust, doubt
from sindyjoint.workflows.joints import CAMPAIGNS, CampaignRecord
from sindyjoint.workflows.joints.population import CoefficientScatter, Trend
from sindyjoint.workflows.joints.summary import TEMPERATURE, Batch

# More names than these cannot be read below an axis; characters of a name on a terminal.
KELVIN = 273.15
NORMAL95 = 1.96
STATUS = {"found": "found", "none": "no model", "broken": "broken"}
DIAMONDS = " Diamonds: joints that stand out."


def _coefficient(result: Batch, term: str) -> tuple[CoefficientScatter, Scale]:
    """Return how a coefficient scatters, and the axis of its values."""
    (scatter,) = (s for s in result.population.scatters if s.coefficient == term)
    values = result.values[term]
    return scatter, scaled("", values if np.isfinite(values).any() else 1.0, result.units[term])


def _points(x: Any, result: Batch, scatter: CoefficientScatter, use: Any) -> list[Curve]:
    """Return values with 95 % intervals, the outliers in another colour."""
    values, errors = result.values[scatter.coefficient], result.errors[scatter.coefficient]
    out = np.zeros(values.size, dtype=bool)
    out[list(scatter.outliers)] = True
    return [
        (
            x[keep],
            values[keep],
            {"yerr": NORMAL95 * errors[keep], "fmt": mark, "color": color, "ms": 3.5, "elinewidth": 0.9},
        )
        for keep, color, mark in ((use & ~out, PALETTE[0], "o"), (use & out, ACCENT, "D"))
        if keep.any()
    ]


def draw_joints(result: Batch, ax: Axes, term: str) -> None:
    """Draw one coefficient of every joint, over the mean and the spread of all."""
    scatter, up = _coefficient(result, term)
    values, ids = result.values[term], [record.id for record in result.records]
    x, known = np.arange(values.size), np.isfinite(values)
    half = NORMAL95 * np.hypot(scatter.spread, scatter.mean_error) if scatter.covariate is None else np.nan
    curves: list[Curve] = [
        (None, (scatter.mean - half, scatter.mean + half), {"color": RULE, "lw": 0}),
        (None, scatter.mean, {"color": INK, "lw": 0.9}),
        *_points(x, result, scatter, known),
    ]
    plot(
        ax, "", replace(up, name=up.unit, unit=""), curves, spelled(term, result.motion),
        xlim=(-0.7, values.size - 0.3),
    )  # fmt: skip
    for i in (i for i in scatter.outliers if known[i]):
        # Towards the middle, so that it stays on the paper.
        right = i < 0.6 * values.size
        ax.annotate(
            plain(shortened(ids[i], 18)), (i, up.factor * values[i]), xytext=(5 if right else -5, 2),
            textcoords="offset points", ha="left" if right else "right", color=ACCENT, fontsize=7,
        )  # fmt: skip
    # More names than these cannot be read below an axis.
    if len(ids) <= 24:
        ax.set_xticks(x, [plain(shortened(name, 14)) for name in ids], rotation=90)
    else:
        ax.set_xlabel("campaign, in the order of the table")


def draw_trend(result: Batch, ax: Axes, trend: Trend) -> None:
    """Draw one coefficient over a covariate with its line and the 95 % interval of the slope."""
    scatter, up = _coefficient(result, trend.coefficient)
    values, x = result.values[trend.coefficient], result.covariates[trend.covariate]
    of = result.covariate_units.get(trend.covariate, "")
    shift = KELVIN if trend.covariate == TEMPERATURE and of == "K" else 0.0
    use = np.isfinite(values) & np.isfinite(x)
    centre, line = float(np.mean(x[use])), np.linspace(x[use].min(), x[use].max(), 101)
    level = float(np.median(values[use] - trend.slope * (x[use] - centre)))
    middle, half = level + trend.slope * (line - centre), NORMAL95 * trend.slope_error * np.abs(line - centre)
    curves = [
        (line - shift, (middle - half, middle + half), {"color": RULE, "lw": 0}),
        (line - shift, middle, {"color": INK, "lw": 1.0}),
        *_points(x - shift, result, scatter, use),
    ]
    unit = f" ({'°C' if shift else pretty_unit(of)})" if of else ""
    name = f"{spelled(trend.coefficient, result.motion)} ({up.unit})"
    plot(ax, plain(trend.covariate + unit), replace(up, name=name, unit=""), curves)
    said = f"{signed_percent(trend.change)} over the range, p = {trend.p_adjusted:.2g}"
    ax.set_title(said.replace("-", "−"), color=MUTED)


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


def _kinds(data: Batch) -> Mapping[str, Kind]:
    """Return the figures; of signs that no joint has, the caption says nothing."""
    if any(scatter.outliers for scatter in data.population.scatters):
        return KINDS
    return KINDS | {
        "joints": replace(KINDS["joints"], caption=KINDS["joints"].caption.removesuffix(DIAMONDS))
    }


def _simulated(result: Batch) -> bool:
    """Return whether all campaigns that were worked on are virtual tests."""
    texts = [" ".join((record.result or {}).get("warnings", ())) for record in result.records]
    return bool(texts) and all("simulated" in text and "not measured" in text for text in texts)


def _fit(record: CampaignRecord) -> dict[str, Any]:
    return (record.result or {}).get("fit", {})


def _share(record: CampaignRecord, name: str) -> str:
    """Return residual or noise floor of a campaign's model, of the RMS that was explained."""
    fit = _fit(record)
    if not fit.get("moment_rms") or fit.get("residual_rms") is None:
        return DASH
    return "unknown" if fit.get(name) is None else percent(fit[name] / fit["moment_rms"])


def joints_table(result: Batch) -> TextTable:
    """Return the table that people read: a row for each campaign."""
    records = result.records
    outlying = {(i, s.coefficient) for s in result.population.scatters for i in s.outliers}

    def celsius(i: int) -> str:
        kelvin = records[i].joint.get("temperature")
        return f"{kelvin - KELVIN:.4g}".replace("-", "−") if kelvin else DASH

    def coefficient(i: int, term: str) -> str:
        text = estimate(float(result.values[term][i]), float(result.errors[term][i]))
        return f"{text} !" if (i, term) in outlying else text

    columns: dict[str, Callable[[int], str]] = {
        "campaign": lambda i: records[i].id,
        "joint": lambda i: records[i].joint.get("name", DASH),
        "serial": lambda i: records[i].joint.get("serial") or DASH,
        "°C": celsius,
        "result": lambda i: STATUS[records[i].status],
        "residual": lambda i: _share(records[i], "residual_rms"),
        "floor": lambda i: _share(records[i], "noise_floor"),
        **{
            with_unit(term, result.units[term], result.motion): partial(coefficient, term=term)
            for term in result.common
        },
    }
    for name, key in {"serial": "serial", "°C": "temperature"}.items():
        if not any(record.joint.get(key) for record in records):
            del columns[name]
    return tabulate("joints", "All joints", range(len(records)), columns, text=("joint",))


def scatter_table(result: Batch) -> TextTable:
    """Return the scatter of each common coefficient over the joints."""

    def spread(s: CoefficientScatter) -> str:
        share = s.spread / abs(s.mean) if s.mean else float("nan")
        return f"{100 * share:.1f} %" if np.isfinite(share) else DASH

    return tabulate(
        "scatter",
        "Between joints, beyond the errors of the single estimates; next joint: where the coefficient of one that was "
        "not tested lies in 95 of 100 cases.",
        result.population.scatters,
        {
            "term": lambda s: with_unit(s.coefficient, result.units[s.coefficient], result.motion),
            "mean of the joints": lambda s: estimate(s.mean, s.mean_error),
            "spread between joints": spread,
            "next joint, 95 %": lambda s: (
                "{:.4g} … {:.4g}".format(*ahead) if (ahead := s.next_joint95) is not None else DASH
            ),
            "stand out": lambda s: ", ".join(result.records[i].id for i in s.outliers) or "none",
        },
    )


def trends_table(result: Batch) -> TextTable:
    """Return the trends, the surest first."""

    def slope(t: Trend) -> str:
        step = pretty_unit(result.covariate_units.get(t.covariate, "step"))
        return f"{estimate(t.slope, t.slope_error)} {pretty_unit(result.units[t.coefficient])} per {step}"

    return tabulate(
        "trends",
        "Robust weighted lines; p over all corrects for the number of trends looked for.",
        sorted(result.population.trends, key=lambda t: t.p_value),
        {
            "trend": lambda t: f"{spelled(t.coefficient, result.motion)} with {t.covariate}",
            "slope": slope,
            "over the range": lambda t: signed_percent(t.change),
            "p": lambda t: f"{t.p_value:.2g}",
            "p over all": lambda t: f"{t.p_adjusted:.2g}",
            "at 5 %": lambda t: "yes" if t.significant else "not seen",
        },
    )


def headline(result: Batch) -> str:
    """Return how many campaigns there are and how they ended."""
    counts = {"without": result.none, "broken": result.broken, "of them done before": result.kept}
    many = f"{len(result.records)} campaign{'s' * (len(result.records) != 1)}: {result.found} with a model"
    return ", ".join([many, *(f"{count} {words}" for words, count in counts.items() if count)])


def _trust(result: Batch) -> Trust:
    """Return whether the joints can be compared and are alike, and what to do next."""
    lost = [record for record in result.records if record.status != "found"]
    apart = list(dict.fromkeys(difference.id for difference in result.differences))
    common = ", ".join(map(spelled, result.common))
    lights = (
        Light("models", "fair" if result.found else "poor", f"none in {list_some([r.id for r in lost])}")
        if lost
        else Light("models", "good", "one in every campaign"),
        doubt(
            "compared",
            "on nothing: no term is in more than half of the models" * (not common),
            f"on the terms of more than half of the models: {common}",
        ),
        doubt(
            "alike",
            f"{list_some(apart)} differ from the others: see which joints differ" * bool(apart)
            or f"{result.found} joints; an outlier shows among {POLICY.scatter} or more"
            * (result.found < POLICY.scatter),
            "no coefficient leaves the distribution of the others",
        ),
    )
    where = {record.id: shlex.quote(record.manifest) for record in result.records}
    broken = [
        (f"sindyjoint check {where[record.id]}", f"see what stands against a model of {record.id}")
        for record in lost
    ]
    odd = [
        (f"sindyjoint diagnose {where[name]}", f"see what {name} has that the other joints have not")
        for name in apart
        if name in where
    ]
    again = ("test the next joint, and run this command again", "see whether it is like these")
    return Trust(lights, (*broken[:1], *odd[:1]) or (again,))


def _link(record: CampaignRecord, folder: Path | None) -> str:
    """Return where the page of a campaign lies, from this one; nothing where there is none of this result."""
    page = f"{CAMPAIGNS}/{record.id}/report.html"
    there = folder is not None and record.status != "broken" and (folder / page).is_file()
    return quote(page) if there else ""


def _page(result: Batch, data: Batch, show: Blocks) -> Page:
    """Return which joints differ, all of them, scatter and trends; rows are linked to the campaigns' pages."""
    trends = result.population.trends
    facts = [
        ("Campaigns", str(len(result.records)), f"{result.found} with a model"),
        ("Stand out", str(len({d.id for d in result.differences})), "see the list below"),
        ("Trends", str(sum(t.significant for t in trends)), f"of {len(trends)} looked for, at 5 % over all"),
    ]
    differ = [markup("<strong>{}</strong>: {}.").format(d.id, d.text) for d in result.differences]
    marked = " An exclamation mark: it stands out." * any(s.outliers for s in result.population.scatters)
    title = (
        "Coefficients of the common terms with one standard error; residual and noise floor as shares of the RMS "
        f"load.{marked}"
    )
    links = [_link(record, show.folder) for record in result.records]
    return Page(
        headline(result),
        "Batch of campaigns",
        headline(result),
        "",
        (show.facts(facts), show.warnings(result.notes)),
        (),
        (
            section(
                "differ",
                "Which joints differ",
                "Differences",
                show.items(differ or [sentence(_trust(result).lights[-1].sentence)]),
            ),
            section(
                "joints",
                "All joints",
                "Joints",
                show.pictures("joints"),
                show.table(replace(joints_table(result), title=title), links),
            ),
            section("scatter", "How the joints scatter", "Scatter", show.tables(scatter_table(result))),
            section("trends", "Trends", "Trends", show.pictures("trends"), show.tables(trends_table(result))),
        ),
    )


def _printed(result: Batch, console: Console) -> Iterator[Any]:
    """Yield the table, in blocks as wide as the screen."""
    joints = joints_table(result)
    rows = tuple(tuple(shortened(cell, 24) for cell in row) for row in joints.rows)
    yield ""
    for block in fitting_blocks(replace(joints, rows=rows, ruled=True), console.width):
        yield from (block, "")


def _warnings(result: Batch) -> list[str]:
    """Return what stands out, the trends and the notes."""
    trends = (
        f"trend: {spelled(each.coefficient, result.motion)} changes by {100 * each.change:+.1f} % over the range "
        f"of the {each.covariate} (p = {each.p_adjusted:.2g})"
        for each in result.population.trends
        if each.significant
    )
    return [
        *(f"{one.id}: {one.text}" for one in result.differences),
        *trends,
        *(f"note: {note}" for note in result.notes),
    ]


def batch_csv(result: Batch) -> str:
    """Return one line per campaign as CSV: numbers in full, SI."""
    series: dict[str, Mapping[str, Any]] = {
        "": result.values,
        "_standard_error": result.errors,
        "_score": {s.coefficient: s.scores for s in result.population.scatters},
    }
    labels = dict.fromkeys(key for record in result.records for key in record.joint.get("labels", {}))
    rows = [
        {
            "campaign": record.id,
            "manifest": record.manifest,
            "status": record.status,
            "joint": record.joint.get("name"),
            "motion": record.joint.get("motion"),
            "serial": record.joint.get("serial"),
            "temperature_K": record.joint.get("temperature"),
            **{label: record.joint.get("labels", {}).get(label) for label in labels},
            "terms": " ".join(record.terms),
            "paper_term_set": (record.result or {}).get("paper_term_set", {}).get("verdict", ""),
            **{key: _fit(record).get(key) for key in ("moment_rms", "residual_rms", "noise_floor")},
            **{term + of: float(series[of][term][i]) for term in result.common for of in series},
            "stands_out": "; ".join(d.text for d in result.differences if d.id == record.id),
            "reason": record.reason,
        }
        for i, record in enumerate(result.records)
    ]
    return csv_records(rows)


_ENDS: dict[str, Callable[[CampaignRecord], str]] = {
    "campaign": lambda record: record.id,
    "status": lambda record: record.status,
    "terms": lambda record: " ".join(term["id"] for term in (record.result or {}).get("terms", ())),
    "reason": lambda record: record.reason,
}
BATCH = View(
    about=lambda result: f"{escape(headline(result))}{', all of them simulated' * _simulated(result)}",
    data=Batch,
    rows="campaigns",
    kind="Batch",
    folder="batch",
    headline=_trust,
    question="Are the joints alike?",
    kinds=_kinds,
    record_file="batch.json",
    judged_by=lambda result: (*FINDING, "batch"),
    # The result of each campaign lies in the folder of the campaign.
    kept=lambda data: replace(
        data, records=tuple(replace(record, result=None, earlier=None) for record in data.records)
    ),
    simulated=_simulated,
    tables=lambda result: (joints_table(result), scatter_table(result), trends_table(result)),
    page=_page,
    inputs=lambda result: [path for record in result.records if (path := Path(record.manifest)).is_file()],
    files=lambda result, data: {"batch.csv": batch_csv(result)},
    printed=_printed,
    warnings=_warnings,
    details=lambda result: aligned(tabulate("ends", "", result.records, _ENDS)),
)
