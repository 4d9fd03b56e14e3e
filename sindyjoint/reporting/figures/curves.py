"""The figures of curves: of a joint over amplitude, of a structure over frequency and amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.reporting.figures.kind import Kind, Panel, by_name, each
from sindyjoint.reporting.style import (
    DASHES,
    INK,
    MUTED,
    PALETTE,
    legend_above,
    plain,
    prefixed,
    shortened,
)
from sindyjoint.substructure.joint_curves import JointCurves
from sindyjoint.substructure.modes import ModeCurve
from sindyjoint.substructure.structure_curves import StructureCurves

if TYPE_CHECKING:
    from matplotlib.axes import Axes


UNITS = {"rotation": ("rad", "N*m/rad"), "translation": ("m", "N/m")}


# ---- of a joint


def stiffness(data: JointCurves, ax: Axes) -> Axes:
    """Draw secant stiffness over amplitude, and the storage stiffness beside it."""
    factor, unit = prefixed(max(float(np.max(c.secant)) for c in data.curves), UNITS[data.motion][1])
    _over_amplitude(data, ax, "secant", factor)
    for curve in data.curves[:1]:
        ax.plot(
            curve.amplitude * _per_angle(data), curve.storage * factor, color=MUTED, lw=0.8, ls=DASHES[2],
            label="storage stiffness",
        )  # fmt: skip
    ax.set_ylabel(f"Secant stiffness ({unit})")
    legend_above(ax, 2, columns=2)
    return ax


def loss_factor(data: JointCurves, ax: Axes) -> Axes:
    """Draw the loss factor over amplitude."""
    _over_amplitude(data, ax, "loss_factor", 1.0)
    ax.set(yscale="log", ylabel="Loss factor")
    legend_above(ax, 1, columns=2)
    return ax


def energy(data: JointCurves, ax: Axes) -> Axes:
    """Draw the energy dissipated per cycle over amplitude."""
    factor, unit = prefixed(max(float(np.max(c.energy)) for c in data.curves), "J")
    _over_amplitude(data, ax, "energy", factor)
    ax.set(yscale="log", ylabel=f"Energy per cycle ({unit})")
    legend_above(ax, 1, columns=2)
    return ax


def _per_angle(data: JointCurves) -> float:
    return prefixed(data.tested_angle or data.curves[0].amplitude[-1], UNITS[data.motion][0])[0]


def _over_amplitude(data: JointCurves, ax: Axes, measure: str, factor: float) -> None:
    """Draw a measure at each frequency with its 95 % band; dotted where the model was not tested."""
    for place, curve in enumerate(data.curves):
        color = PALETTE[place % len(PALETTE)]
        x, y = curve.amplitude * _per_angle(data), getattr(curve, measure) * factor
        low, high = (end * factor for end in curve.interval95(measure))
        ax.fill_between(x, np.maximum(low, 1e-3 * y), high, color=color, alpha=0.2, lw=0)
        dash = DASHES[place % len(DASHES)]
        ax.plot(x, _only(y, curve.tested), color=color, ls=dash, label=f"{curve.frequency:.3g} Hz")
        ax.plot(x, _only(y, ~curve.tested), color=color, ls=(0, (1, 2)), lw=0.9)
    ax.set_xscale("log")
    if data.tested_angle > 0:
        ax.axvline(
            data.tested_angle * _per_angle(data), color=INK, lw=0.7, ls=(0, (4, 2)), label="tested up to"
        )
    _, unit = prefixed(data.tested_angle or data.curves[0].amplitude[-1], UNITS[data.motion][0])
    ax.set_xlabel(f"{'Angle' if data.motion == 'rotation' else 'Displacement'} amplitude ({unit})")


def _only(values: Array, where: NDArray[np.bool_]) -> Array:
    """Return the values where a mark holds, and one beyond on either side, so that lines meet."""
    wide = where | np.append(where[1:], False)
    return np.where(wide, values, np.nan)


JOINT_KINDS = by_name(
    Kind(
        "stiffness",
        "Stiffness over amplitude",
        "Stiffness between the ends of the loop under a harmonic motion; dots: beyond what was tested.",
        lambda data: [stiffness],
    ),
    Kind(
        "loss",
        "Loss factor over amplitude",
        "Energy per cycle over 2π times the stored energy; dots: beyond what was tested.",
        lambda data: [loss_factor],
    ),
    Kind(
        "energy",
        "Energy per cycle over amplitude",
        "Area of the loop; dots: beyond what was tested.",
        lambda data: [energy],
    ),
)


# ---- of a structure


def response(data: StructureCurves, ax: Axes) -> Axes:
    """Draw amplitude over frequency at each level, and the backbone through the peaks."""
    factor, unit = prefixed(max(float(np.max(level.amplitude)) for level in data.levels), "m")
    _levels(data, ax, lambda level: factor)
    low, high = ax.get_ylim()
    for mode in data.modes:
        if mode.point == data.point:
            seen = (mode.amplitude * factor >= low) & (mode.amplitude * factor <= high)
            ax.plot(
                mode.frequency[seen], mode.amplitude[seen] * factor, color=INK, lw=1.1, ls=DASHES[1],
                label=f"backbone, mode {mode.number}" if seen.any() else None,
            )  # fmt: skip
    ax.set_ylabel(f"Deflection at {plain(shortened(data.point, 14))} ({unit})")
    ax.legend(loc="upper right", labelspacing=0.3)
    return ax


def receptance(data: StructureCurves, ax: Axes) -> Axes:
    """Draw amplitude per force over frequency at each level: of a linear structure they would be one curve."""
    largest = max(float(np.max(level.amplitude / level.force)) for level in data.levels)
    factor, unit = prefixed(largest, "m/N")
    _levels(data, ax, lambda level: factor / level.force)
    for names, values in (("joints locked", data.locked), ("joints sliding freely", data.sliding)):
        ax.axvline(
            values[0], color=MUTED, lw=0.7, ls=DASHES[2 if names == "joints locked" else 4], label=names
        )
    ax.set_ylabel(f"Receptance ({unit})")
    ax.legend(loc="upper right", labelspacing=0.3)
    return ax


def _levels(data: StructureCurves, ax: Axes, factor: object) -> None:
    """Draw each level with its band: dashed between folds, dotted beyond what was tested."""
    assert callable(factor)
    for place, level in enumerate(data.levels):
        color, share = PALETTE[place % len(PALETTE)], factor(level)
        if np.any(level.frequency_error) or np.any(level.log_error):
            edges = [level.band95(side) for side in (-1, 1)]
            x = np.concatenate([edges[0][0], edges[1][0][::-1]])
            y = np.concatenate([edges[0][1], edges[1][1][::-1]]) * share
            ax.fill(x, y, color=color, alpha=0.25, lw=0)
        shown = level.amplitude * share
        solid = level.stable & level.tested
        ax.plot(level.frequency, _only(shown, solid), color=color, label=f"{level.force:.3g} N")
        ax.plot(level.frequency, _only(shown, ~level.stable), color=color, ls=(0, (4, 2)), lw=0.9)
        ax.plot(
            level.frequency, _only(shown, level.stable & ~level.tested), color=color, ls=(0, (1, 1.5)), lw=1.0
        )
    ax.set(yscale="log", xlabel="Frequency (Hz)")


def backbone(data: StructureCurves, mode: ModeCurve, ax: Axes) -> Axes:
    """Draw the frequency of a mode over its amplitude."""
    _mode(data, mode, ax, mode.frequency, mode.frequency_error)
    ax.set_ylabel(f"Frequency of mode {mode.number} (Hz)")
    return ax


def damping(data: StructureCurves, mode: ModeCurve, ax: Axes) -> Axes:
    """Draw the damping ratio of a mode over its amplitude."""
    _mode(data, mode, ax, 100 * mode.damping, 100 * mode.damping_error)
    ax.set_ylim(bottom=0)
    ax.set_ylabel(f"Damping ratio of mode {mode.number} (%)")
    return ax


def _mode(data: StructureCurves, mode: ModeCurve, ax: Axes, values: Array, errors: Array) -> None:
    factor, unit = prefixed(float(mode.amplitude[-1]), "m")
    x = mode.amplitude * factor
    if np.any(errors):
        ax.fill_between(x, values - 1.96 * errors, values + 1.96 * errors, color=PALETTE[0], alpha=0.25, lw=0)
    ax.plot(x, _only(values, mode.tested), color=PALETTE[0])
    ax.plot(x, _only(values, ~mode.tested), color=PALETTE[0], ls=(0, (1, 1.5)))
    for place, (name, slip) in enumerate(zip(data.joints, mode.slips, strict=True)):
        if np.isfinite(slip) and 0 < slip <= mode.amplitude[-1]:
            ax.axvline(
                slip * factor, color=MUTED, lw=0.8, ls=DASHES[1 + place % (len(DASHES) - 1)],
                label=f"{plain(shortened(name, 12))} slips",
            )  # fmt: skip
    ax.set(xscale="log", xlabel=f"Deflection at {plain(shortened(mode.point, 14))} ({unit})")
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best", labelspacing=0.3)


def _panels(draw: object) -> object:
    def panels(data: StructureCurves) -> list[Panel]:
        return each(lambda one: one.modes, lambda mode, ax: draw(data, mode, ax))(data)  # type: ignore[operator]

    return panels


STRUCTURE_KINDS = by_name(
    Kind(
        "response",
        "Frequency response by level",
        "First harmonic of the deflection at each level of the force, and the backbone through the peaks. Dashes: "
        "between two folds, where no test stays; dots: beyond what was tested.",
        lambda data: [response] if data.levels else [],
        wide=True,
    ),
    Kind(
        "receptance",
        "Receptance by level",
        "Deflection per force: of a linear structure the levels would be one curve.",
        lambda data: [receptance] if data.levels else [],
        wide=True,
    ),
    Kind(
        "backbone",
        "Frequency over amplitude",
        "Of each mode; a joint slips from its mark on. Dots: beyond what was tested.",
        _panels(backbone),  # type: ignore[arg-type]
    ),
    Kind(
        "damping",
        "Damping over amplitude",
        "Ratio to critical damping of each mode; a joint slips from its mark on. Dots: beyond what was tested.",
        _panels(damping),  # type: ignore[arg-type]
    ),
)
