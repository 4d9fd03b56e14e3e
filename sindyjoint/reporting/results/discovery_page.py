"""What the page of a discovery says in numbers: the facts of its first screen, its runs, the path round its choice."""

from __future__ import annotations

import math
from typing import Any

from sindyjoint.equation.model import INERTIA
from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.style import prefixed, pretty_unit
from sindyjoint.text import quantities

# Of a joint whose inertia is not declared, and is no term of the model.
NO_INERTIA = "its load is too small on these runs to be told from the other terms"


def key_facts(data: ReportData) -> list[tuple[str, str, str]]:
    """Return what the first screen states in numbers: (label, value, explanation)."""
    fitted, q = data.model.fitted, quantities(data.model.joint.motion)
    factor, unit = prefixed(fitted.residual_rms, q.moment_unit)
    explained = 1 - (fitted.residual_rms / fitted.moment_rms) ** 2 if fitted.moment_rms > 0 else math.nan
    floor = f"{fitted.noise_floor * factor:.3g} {unit}" if math.isfinite(fitted.noise_floor) else "unknown"
    frequencies = ", ".join(f"{f:.4g}" for f in fitted.frequencies)
    inertia = data.model.inertia
    known = "declared" if data.model.joint.inertia is not None else "identified"
    facts = [
        (
            f"{q.moment} explained",
            f"{100 * explained:.2f} %" if data.model.terms else "none",
            "of the mean square, where it moves",
        ),
        ("Residual", f"{fitted.residual_rms * factor:.3g} {unit} RMS", f"noise floor {floor}"),
        (
            "Tested",
            f"{fitted.runs} run{'s' if fitted.runs != 1 else ''}",
            f"{frequencies} Hz" if frequencies else "without time" if fitted.quasi_static else "aperiodic",
        ),
        (
            "Moving samples",
            f"{fitted.samples:,}".replace(",", "\u202f"),
            f"{100 * fitted.moving_fraction:.0f} % of all; the others stick or reverse",
        ),
    ]
    if fitted.quasi_static:
        facts.append((f"{q.inertia}, damping, frequency", "not applicable", "the samples have no time"))
    elif data.model.joint.inertia is None and INERTIA not in data.model:
        facts.append((q.inertia, "not found", NO_INERTIA))
    else:
        known += ": negative, which is impossible" if inertia < 0 else ""
        facts.append((q.inertia, f"{inertia:.4g} {pretty_unit(q.inertia_unit)}", known))
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
