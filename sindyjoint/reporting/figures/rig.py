"""The figures of a rig in motion, and what they are drawn from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.reporting.figures.kind import Kind, bars, by_name, fixed
from sindyjoint.reporting.style import DASHES, MUTED, PALETTE, legend_above, plain, prefixed, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.workflows.rig import RigMotion


# What a picture shows of a curve.
DRAWN_SAMPLES = 4000


@dataclass(frozen=True, eq=False)
class RigFigures:
    """What the pictures of a rig in motion are drawn from.

    Parameters
    ----------
    name : str
    time : ndarray, shape (n,)
        s.
    displacement : dict of str to ndarray, shape (n,)
        m.
    joints : tuple of str
    angle : ndarray, shape (joints, n)
        rad.
    locked : ndarray, shape (joints,)
        Share of the time.
    heat : dict of str to float
        J.
    """

    name: str
    time: Array
    displacement: dict[str, Array]
    joints: tuple[str, ...]
    angle: Array
    locked: Array
    heat: dict[str, float]


def figures_of(result: RigMotion) -> RigFigures:
    """Return what is drawn of a rig in motion."""
    response = result.response
    step = -(-response.time.size // DRAWN_SAMPLES)
    return RigFigures(
        name=result.rig.name,
        time=response.time[::step],
        displacement={name: values[::step] for name, values in response.displacement.items()},
        joints=response.joints,
        angle=response.angle[:, ::step],
        locked=response.stuck.mean(axis=1),
        heat=result.heat,
    )


def deflection(result: RigFigures, ax: Axes) -> Axes:
    """Draw the deflection of the output points over time."""
    _lines(ax, result.time, result.displacement, "m")
    ax.set(ylabel=f"Deflection ({ax.get_ylabel()})", title=plain(shortened(result.name)))
    return ax


def angles(result: RigFigures, ax: Axes) -> Axes:
    """Draw the angle of every joint over time."""
    _lines(ax, result.time, dict(zip(result.joints, result.angle, strict=True)), "rad")
    ax.set_ylabel(f"Joint angle ({ax.get_ylabel()})")
    return ax


def _lines(ax: Axes, time: Array, signals: dict[str, Array], unit: str) -> None:
    largest = max((float(np.abs(values).max()) for values in signals.values()), default=1.0)
    factor, shown = prefixed(largest, unit)
    for index, (name, values) in enumerate(signals.items()):
        color, dash = PALETTE[index % len(PALETTE)], DASHES[index % len(DASHES)]
        ax.plot(time, values * factor, lw=0.8, color=color, ls=dash, label=plain(shortened(name, 18)))
    ax.set(xlabel="Time (s)", ylabel=shown)
    legend_above(ax, -(-len(signals) // 2) + 1, columns=2)


def heat(result: RigFigures, ax: Axes) -> Axes:
    """Draw who dissipates how much of what became heat."""
    total = sum(result.heat.values()) or 1.0
    shares = [100 * value / total for value in result.heat.values()]
    return bars(ax, _names(result.heat), shares, 115, "Share of what became heat, %", PALETTE[0], "{:.1f}")


def locked(result: RigFigures, ax: Axes) -> Axes:
    """Draw the share of the time in which each joint is locked."""
    shares = (100 * result.locked).tolist()
    return bars(ax, _names(result.joints), shares, 115, "Share of the time locked, %", MUTED, "{:.1f}")


def _names(names: Iterable[str]) -> list[str]:
    return [plain(shortened(name, 18)) for name in names]


KINDS = by_name(
    Kind(
        "deflection",
        "Deflection",
        "Deflection of the output points over time.",
        fixed(deflection),
        wide=True,
    ),
    Kind(
        "angles",
        "Joint angles",
        "Angle of every joint over time; where a line is flat the joint is locked.",
        fixed(angles),
        wide=True,
    ),
    Kind(
        "heat",
        "Dissipation",
        "Who dissipates how much of what became heat.",
        fixed(heat),
    ),
    Kind(
        "locked",
        "Locked",
        "Share of the time in which each joint is locked.",
        fixed(locked),
    ),
)
