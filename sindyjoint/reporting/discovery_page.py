"""The report page of a discovery."""

from __future__ import annotations

import math
from typing import Any

from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.equation import mathml, symbol_html
from sindyjoint.reporting.figures import DISCOVERY
from sindyjoint.reporting.interactive import loops_payload, map_payload
from sindyjoint.reporting.page import inline_svg, markup, render
from sindyjoint.reporting.provenance import Provenance
from sindyjoint.reporting.style import prefixed, pretty_unit
from sindyjoint.reporting.tables import term_rows
from sindyjoint.reporting.units import quantities

HEADLINES = {
    "confirmed": "The paper’s five terms describe this joint.",
    "refuted": "The paper’s five terms, as they stand, do not describe this joint.",
    "undecided": "These data do not decide whether the paper’s five terms describe this joint.",
}
NO_MODEL = "No set of terms passed: these data give no model of this joint."


def discovery_page(data: ReportData, origin: Provenance, pictures: dict[str, bytes]) -> str:
    """Return the report of a discovery as one HTML text.

    Parameters
    ----------
    data : ReportData
    origin : Provenance
    pictures : dict of bytes
        SVG by kind of figure.
    """
    return render(
        "discovery.html.j2",
        title=f"{data.model.joint.name}: terms of the joint",
        data=data,
        origin=origin,
        headline=HEADLINES[data.verdict] if data.model.terms else NO_MODEL,
        facts=key_facts(data),
        equation=markup(mathml(data.model)),
        equation_text=data.model.equation(),
        equation_latex=data.model.latex(),
        terms=term_rows(data.model),
        symbols=[markup(symbol_html(term.symbol)) for term in data.model.terms],
        runs=run_rows(data),
        steps=step_rows(data),
        kinds=DISCOVERY,
        pictures={
            kind: markup(inline_svg(svg, kind, DISCOVERY[kind].title)) for kind, svg in pictures.items()
        },
        payload={"map": map_payload(data), "loops": loops_payload(data)},
    )


def key_facts(data: ReportData) -> list[tuple[str, str, str]]:
    """Return what the first screen states in numbers: (label, value, explanation)."""
    fitted, q = data.model.fitted, quantities(data.model.joint.motion)
    factor, unit = prefixed(fitted.residual_rms, q.moment_unit)
    explained = 1 - (fitted.residual_rms / fitted.moment_rms) ** 2 if fitted.moment_rms > 0 else math.nan
    floor = f"{fitted.noise_floor * factor:.3g} {unit}" if math.isfinite(fitted.noise_floor) else "unknown"
    frequencies = ", ".join(f"{f:.4g}" for f in fitted.frequencies)
    inertia = data.model.inertia
    known = "declared" if data.model.joint.inertia is not None else "identified" if inertia else "not known"
    facts = [
        (
            f"{q.moment} explained",
            f"{100 * explained:.2f} %" if data.model.terms else "none",
            "of the mean square, where it moves",
        ),
        ("Left over", f"{fitted.residual_rms * factor:.3g} {unit} RMS", f"noise floor {floor}"),
        (
            "Tested",
            f"{fitted.runs} run{'s' if fitted.runs != 1 else ''}",
            f"{frequencies} Hz" if frequencies else "aperiodic",
        ),
        (
            "Moving samples",
            f"{fitted.samples:,}".replace(",", "\u202f"),
            f"{100 * fitted.moving_fraction:.0f} % of all; the rest sticks or reverses",
        ),
    ]
    unit = "kg" if data.translation else "kg*m^2"
    facts.append(("Mass" if data.translation else "Inertia", f"{inertia:.4g} {pretty_unit(unit)}", known))
    return facts


def run_rows(data: ReportData) -> list[dict[str, Any]]:
    """Return one row for each run."""
    q = quantities(data.model.joint.motion)
    factor, unit = prefixed(data.model.fitted.residual_rms, q.moment_unit)
    return [
        {
            "run": loop.run,
            "frequency": loop.frequency,
            "level": loop.level or "",
            "method": loop.method,
            "samples": loop.samples,
            "moving": loop.moving_fraction,
            "noise": loop.moment_noise * factor,
            "residual": loop.residual_rms * factor,
            "unit": unit,
        }
        for loop in data.loops
    ]


def step_rows(data: ReportData) -> list[dict[str, Any]]:
    """Return the models of the path around the chosen one, with what the next larger one added."""
    q = quantities(data.model.joint.motion)
    factor, unit = prefixed(data.model.fitted.residual_rms, q.moment_unit)
    rows = []
    for index, step in enumerate(data.path):
        smaller = set(data.path[index + 1].terms) if index + 1 < len(data.path) else set()
        rows.append(
            {
                "size": len(step.terms),
                "added": [t for t in step.terms if t not in smaller],
                "dropped": sorted(smaller - set(step.terms)),
                "residual": step.residual_rms * factor,
                "held_out": step.held_out_rms * factor,
                "threshold": step.threshold,
                "least_t": step.least_t,
                "chosen": index == data.chosen,
                "unit": unit,
            }
        )
    return rows
