"""Simscape: a MATLAB script with the parameters of a spring, a damper and a friction block in parallel.

Elements with internal states are a custom component beside them, in a file of its own.
"""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.export import lumped
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table
from sindyjoint.export.parts import RAMP, Curve, Parts
from sindyjoint.export.text import ascii_line, comment, number, preamble, words_of
from sindyjoint.numeric import Array

POINTS = 41
NAME = "sindyjoint_elements"


def export(model: JointModel) -> Export:
    """Write ``joint.m`` and, for a model with elements, ``sindyjoint_elements.ssc``."""
    parts, cycles = Parts.of(model), Cycles.of(model)
    curve = lumped.elastic_curve(parts, POINTS)
    rates = lumped.rate_curve(parts, parts.other_rate)
    threshold = RAMP * model.fitted.rate  # the block reaches 76 % of its friction here: ω_Coul
    words = words_of(model)
    kind = "Rotational" if model.joint.motion == "rotation" else "Translational"
    rows = fidelity_table(
        model,
        cycles,
        {
            **lumped.elastic_rows(parts, cycles, curve.x, f"Nonlinear {kind} Spring, table of {POINTS} points"),
            **_friction_rows(parts, cycles, threshold, kind),
            **lumped.rate_rows(
                parts, parts.other_rate, cycles, rates.x, f"Nonlinear {kind} Damper, table of {rates.x.size} points"
            ),
            **lumped.left_out(
                parts.coupled, f"these blocks have no {words.moment} of {words.angle} and {words.rate} together"
            ),
            **lumped.inertial_rows(parts),
            **{e.id: Represented(f"component {NAME}", cycles.element(e)) for e in model.elements},
        },
    )  # fmt: skip
    notes = (
        f"put the blocks in parallel: Nonlinear {kind} Spring and Damper (Simscape Driveline, by table lookup, linear "
        f"interpolation) and {kind} Friction (Foundation Library)",
        *(
            (
                f"elements are the custom component {NAME} in {NAME}.ssc, in parallel to the blocks; its internal "
                "states are variables, and its ports are R and C as those of the blocks",
            )
            if model.elements
            else ()
        ),
        *(
            (
                f"the friction block is a smooth curve, tanh({words.rate}/{threshold:.4g}): it creeps instead of "
                f"sticking, slower than that {words.rate}",
            )
            if parts.friction > 0
            else ()
        ),
        lumped.range_note(model, "set the extrapolation method to linear"),
        *lumped.inertia_note(model),
    )
    text = comment(preamble(model, "Simscape", rows, notes), "%")
    text += _script(model, parts, curve, rates if parts.other_rate else None, threshold)
    files: dict[str, str | bytes] = {"joint.m": text}
    if model.elements:
        # sympy is imported for code alone.
        from sindyjoint.export.simscape_component import component

        files[f"{NAME}.ssc"] = component(model, NAME, comment(preamble(model, "Simscape", rows, notes), "%"))
    return Export("simscape", files, rows, notes)


def _friction_rows(parts: Parts, cycles: Cycles, threshold: float, kind: str) -> dict[str, Represented]:
    rows: dict[str, Represented] = {}
    if parts.damping >= 0:
        rows |= lumped.viscous_rows(parts, cycles, f"{kind} Friction, viscous coefficient")
    else:
        rows |= lumped.left_out(parts.viscous, "the block's viscous coefficient must not be negative")
    if parts.friction < 0:
        return rows | lumped.left_out(parts.coulomb, "the block's friction must not be negative")
    for term in parts.coulomb:
        smooth = term.coefficient * np.tanh(cycles.rate / threshold)
        rows[term.id] = Represented(
            f"{kind} Friction, Coulomb and breakaway friction; creeps instead of sticking", smooth
        )
    return rows


def _script(model: JointModel, parts: Parts, curve: Curve, rates: Curve | None, threshold: float) -> str:
    unit = words_of(model)
    quantity = "torque" if model.joint.motion == "rotation" else "force"
    name = ascii_line(model.joint.name).replace("'", "''")
    lines = ["joint = struct();", f"joint.name = '{name}';"]
    if parts.elastic:
        lines += [
            *_vector(
                "joint.spring.deformation",
                curve.x,
                f"{unit.angle_unit}, block parameter: vector of deformations",
            ),
            *_vector(
                f"joint.spring.{quantity}",
                curve.y,
                f"{unit.moment_unit}, block parameter: vector of {quantity}s",
            ),
        ]
    if rates is not None:
        lines += [
            *_vector(
                "joint.damper.velocity",
                rates.x,
                f"{unit.angle_unit}/s, block parameter: vector of velocities",
            ),
            *_vector(
                f"joint.damper.{quantity}",
                rates.y,
                f"{unit.moment_unit}, block parameter: vector of {quantity}s",
            ),
        ]
    if parts.friction > 0 or parts.damping > 0:
        friction, damping = max(parts.friction, 0.0), max(parts.damping, 0.0)
        breakaway = 10 * threshold  # the block takes a tenth of it as the threshold of its Coulomb part
        lines += [
            f"joint.friction.breakaway_{quantity} = {number(friction)};  % {unit.moment_unit}",
            f"joint.friction.breakaway_velocity = {number(breakaway)};  % {unit.angle_unit}/s",
            f"joint.friction.coulomb_{quantity} = {number(friction)};  % {unit.moment_unit}",
            f"joint.friction.viscous_coefficient = {number(damping)};  % {unit.damping_unit}",
        ]
    return "\n".join(lines) + "\n"


def _vector(name: str, values: Array, meaning: str) -> list[str]:
    texts = [number(value) for value in values]
    rows = [", ".join(texts[i : i + 5]) for i in range(0, len(texts), 5)]
    return [f"{name} = [ ...  % {meaning}", *(f"    {row}, ..." for row in rows[:-1]), f"    {rows[-1]}];"]
