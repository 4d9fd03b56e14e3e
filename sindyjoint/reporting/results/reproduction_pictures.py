"""The paper's figures again, and what they are drawn from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.paper import PULSE
from sindyjoint.reporting.figure import Axes, Kind, Panel, by_name, fixed
from sindyjoint.reporting.results.verification_pictures import amplitude, period
from sindyjoint.reporting.style import DIVERGING, INK, PALETTE
from sindyjoint.response.verification import RunVerification
from sindyjoint.states import ForceStates
from sindyjoint.states.surface import ForceStateMap

TRUTHS = {"plain": "truth: only the model's terms", "richer": "truth: friction that first gives way"}
# What one panel shows of a response.
COMPARED = 10.0  # s
LEVELS_SHOWN = slice(0, 7, 2)


@dataclass(frozen=True, eq=False)
class JointFigures:
    """What is drawn of one joint.

    Parameters
    ----------
    name : str
    loops : tuple of ndarray, shape (2, n)
        Angle, rad, and moment, N·m, over one period at 3 Hz, level by level.
    surface : ForceStateMap
    """

    name: str
    loops: tuple[Array, ...]
    surface: ForceStateMap


@dataclass(frozen=True, eq=False)
class ReproductionFigures:
    """What the figures of a reproduction are drawn from; saved with them, so that any can be drawn again.

    Parameters
    ----------
    joints : tuple of JointFigures
    linear : ForceStateMap
        Of a linear joint.
    force : ndarray, shape (2, n)
        Time, s, and exciting force, N.
    plain, richer : RunVerification
        Virtual pulse test and model, where the truth holds nothing the model lacks, and where it does.
    """

    joints: tuple[JointFigures, ...]
    linear: ForceStateMap
    force: Array
    plain: RunVerification
    richer: RunVerification


def one_period(state: ForceStates) -> Array:
    """Angle and mean moment of all periods, closed, on a grid of phases."""
    assert state.frequency is not None
    count = 240
    phase = np.mod((state.time - state.time[0]) * state.frequency, 1.0)
    cell = np.minimum((phase * count).astype(int), count - 1)
    number = np.bincount(cell, minlength=count)
    means = [np.bincount(cell, x, minlength=count) / number for x in (state.angle, state.moment)]
    return np.array([np.append(mean, mean[0]) for mean in means])


def loops(result: ReproductionFigures, ax: Axes, joint: JointFigures) -> Axes:
    """Draw moment over angle at 3 Hz for some of the levels: one period each (Figure 5)."""
    dashes = ("-", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
    for (theta, moment), color, dash in zip(joint.loops[LEVELS_SHOWN], PALETTE, dashes, strict=False):
        ax.plot(1e3 * theta, moment, color=color, lw=0.9, ls=dash)
    ax.set(xlabel="Angle $\\theta$ (mrad)", ylabel="Moment $M$ (N·m)", title=f"{joint.name}, 3 Hz")
    return ax


def surface(result: ReproductionFigures, ax: Any, joint: JointFigures | None = None) -> Any:
    """Draw averaged cells as a surface: of a joint, one on each side of zero rate (Figure 7), or of the linear one."""
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    given = joint.surface if joint else result.linear
    limit = float(np.nanmax(np.abs(given.moment)))
    width = [float(edges[1] - edges[0]) for edges in (given.angle_edges, given.rate_edges)]
    for side in (given.rate > 0, given.rate < 0) if joint else (given.filled,):
        keep = given.filled & side
        x, y, z = given.angle[keep], given.rate[keep], given.moment[keep]
        mesh = Triangulation(x / width[0], y / width[1])
        corners = np.stack([mesh.x, mesh.y], axis=1)[mesh.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        # Cells that no run passed stay open, but for the gaps between neighbouring rings.
        mesh = Triangulation(1e3 * x, 1e3 * y, mesh.triangles[longest < 8])
        ax.plot_trisurf(
            mesh, z, cmap=DIVERGING, vmin=-limit, vmax=limit, lw=0.15, edgecolor=(0.1, 0.1, 0.1, 0.5)
        )
    ax.set_title(f"{joint.name}, 3 Hz" if joint else "linear joint, 3 Hz")
    ax.set_xlabel("$\\theta$ (mrad)", labelpad=-2)
    ax.set_ylabel("$\\dot{\\theta}$ (mrad/s)", labelpad=0)
    ax.set_zlabel("$M_T$ (N·m)", labelpad=-6)
    ax.tick_params(pad=-2)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_locator(MaxNLocator(4))
    # From where the surface is not seen edge on; drawn smaller, since the layout does not know of axis labels in 3-D.
    ax.view_init(elev=24, azim=-58 if joint else -125)
    ax.set_box_aspect(None, zoom=0.84)
    return ax


def force(result: ReproductionFigures, ax: Axes) -> Axes:
    """Draw the pulse (Figure 9)."""
    time, values = result.force
    ax.plot(1e3 * time, values, color=PALETTE[0])
    ax.set(xlabel="Time (ms)", ylabel="Force (N)", title="Exciting force")
    return ax


def displacement(result: ReproductionFigures, ax: Axes, truth: str, until: float, model: bool) -> Axes:
    """Draw the displacement of the free end in a virtual test (Figure 10), and the model over it (Figure 11)."""
    run = getattr(result, truth)
    kept = run.time <= until
    ax.plot(run.time[kept], 1e3 * run.measured[kept], color=PALETTE[0], lw=0.8, label="virtual test")
    if model and run.simulated is not None:
        look: Any = {"color": INK, "lw": 0.7, "ls": (0, (3, 1.5)), "label": "identified model"}
        ax.plot(run.time[kept], 1e3 * run.simulated[kept], **look)
    title = TRUTHS[truth] if model else "Displacement of the free end"
    ax.set(xlabel="Time (s)", ylabel="Displacement (mm)", title=title)
    ax.margins(x=0.01)
    if model:
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.2 * (high - low))
        ax.legend(loc="upper right", ncols=2)
    return ax


def half_cycles(result: ReproductionFigures, ax: Axes, truth: str, draw: Callable[[Any, Axes], Axes]) -> Axes:
    """Draw the amplitude or the period by half-cycle of a virtual test and the model."""
    draw(getattr(result, truth), ax).set_title(TRUTHS[truth])
    return ax


def _per_joint(panel: Callable[..., Any]) -> Callable[[Any], list[Panel]]:
    return lambda result: [partial(panel, joint=joint) for joint in result.joints]


_SOLID: dict[str, Any] = {"height": lambda _: 3.2, "projection": "3d"}

KINDS = by_name(
    Kind(
        "figure-05",
        "Figure 5",
        "Figure 5: moment over angle at 3 Hz; four of nine levels, periods averaged.",
        _per_joint(loops),
    ),
    Kind(
        "figure-06",
        "Figure 6",
        "Figure 6: force–state map of a linear spring, mass and damper: an oblique plane.",
        fixed(surface),
        **_SOLID,
    ),
    Kind(
        "figure-07",
        "Figure 7",
        "Figure 7: force–state maps at 3 Hz; moving samples averaged in 24 × 24 cells.",
        _per_joint(surface),
        **_SOLID,
    ),
    Kind("figure-09", "Figure 9", "Figure 9: the exciting force.", fixed(force)),
    Kind(
        "figure-10",
        "Figure 10",
        "Figure 10: displacement of the free end after the pulse, 20 s.",
        fixed(partial(displacement, truth="plain", until=PULSE.compared, model=False)),
        wide=True,
    ),
    Kind(
        "figure-11",
        "Figure 11",
        "Figure 11: virtual test and identified model, first 10 s.",
        fixed(*(partial(displacement, truth=truth, until=COMPARED, model=True) for truth in TRUTHS)),
    ),
    Kind(
        "amplitude-and-period",
        "Amplitude and period",
        "Amplitude and period by half-cycle, of both virtual tests and the model.",
        fixed(
            *(
                partial(half_cycles, truth=truth, draw=draw)
                for truth in TRUTHS
                for draw in (amplitude, period)
            )
        ),
    ),
)
