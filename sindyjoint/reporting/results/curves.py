"""Curves of a joint and of a structure, on a terminal, as pictures, as a page, as files."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.judgement import EXPORT
from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import Curve, Kind, by_name, cycled, fixed, plot, scaled
from sindyjoint.reporting.page import Blocks, Page, Section, capital, section
from sindyjoint.reporting.style import DASHES, INK, MUTED, PALETTE, Axes, amount, shortened
from sindyjoint.reporting.tables import DASH, TextTable, csv_columns, escape, tabulate
from sindyjoint.reporting.view import View
from sindyjoint.substructure.forced import StructureCurves
from sindyjoint.substructure.joint_curves import MEASURES, JointCurves
from sindyjoint.substructure.modes import ModeCurve
from sindyjoint.text import quantities
from sindyjoint.trust import Trust, doubt

# Of angles and stiffnesses, by kind of motion.
UNITS = {"rotation": ("rad", "N*m/rad"), "translation": ("m", "N/m")}
UNTESTED: Any = {"ls": (0, (1, 1.5))}
BAND: Any = {"alpha": 0.2, "lw": 0}


def _parts(x: Array, y: Array, *parts: tuple[NDArray[np.bool_], Any]) -> Iterator[Curve]:
    """Yield a curve part by part, each where a mark holds, with one point beyond on either side: lines meet."""
    for where, look in parts:
        yield x, np.where(where | np.append(where[1:], False), y, np.nan), look


def over_amplitude(data: JointCurves, ax: Axes, measure: str, name: str) -> None:
    """Draw a measure at each frequency with its 95 % band; dotted where the model was not tested."""
    angle, stiffness = UNITS[data.motion]
    unit = {"secant": stiffness, "energy": "J"}.get(measure, "")
    curves: list[Curve] = []
    for place, curve in enumerate(data.curves):
        look, x, y = cycled(place), curve.amplitude, getattr(curve, measure)
        low, high = curve.interval95(measure)
        curves.append((x, (np.maximum(low, 1e-3 * y), high), {"color": look["color"], **BAND}))
        curves += _parts(
            x,
            y,
            (curve.tested, look | {"label": f"{curve.frequency:.3g} Hz"}),
            (~curve.tested, {"color": look["color"], "ls": (0, (1, 2)), "lw": 0.9}),
        )
    first, beside = data.curves[0], measure == "secant"
    storage = {"color": MUTED, "lw": 0.8, "ls": DASHES[2], "label": "storage stiffness"}
    curves += [
        (
            data.tested_angle or None,
            None,
            {"color": INK, "lw": 0.7, "ls": (0, (4, 2)), "label": "tested up to"},
        ),
        *[(first.amplitude, first.storage, storage)] * beside,
    ]
    across = scaled(
        f"{quantities(data.motion).angle} amplitude", data.tested_angle or first.amplitude[-1], angle
    )
    up = scaled(name, [float(np.max(getattr(curve, measure))) for curve in data.curves], unit)
    plot(ax, across, up, curves, columns=2, xscale="log", yscale="linear" if beside else "log")


def over_frequency(data: StructureCurves, ax: Axes, receptance: bool) -> None:
    """Draw amplitude, or amplitude per force, over frequency at each level: dashed between folds, dotted untested."""
    name = "Receptance" if receptance else f"Deflection at {shortened(data.point, 14)}"
    per = [level.force if receptance else 1.0 for level in data.levels]
    largest = [float(np.max(level.amplitude / force)) for level, force in zip(data.levels, per, strict=True)]
    up = scaled(name, largest, "m/N" if receptance else "m")
    curves: list[Curve] = []
    for place, (level, force) in enumerate(zip(data.levels, per, strict=True)):
        look: Any = {"color": PALETTE[place % len(PALETTE)]}
        if np.any(level.frequency_error) or np.any(level.log_error):
            (x0, y0), (x1, y1) = (level.band95(side) for side in (-1, 1))
            edge = np.concatenate([x0, x1[::-1]]), np.concatenate([y0, y1[::-1]]) * up.factor / force
            ax.fill(*edge, alpha=0.25, lw=0, **look)
        stable, tested = level.stable, level.tested
        curves += _parts(
            level.frequency,
            level.amplitude / force,
            (stable & tested, look | {"label": f"{level.force:.3g} N"}),
            (~stable, look | {"ls": (0, (4, 2)), "lw": 0.9}),
            (stable & ~tested, look | UNTESTED | {"lw": 1.0}),
        )
    if receptance:
        ends = (data.locked[0], 2, "joints locked"), (data.sliding[0], 4, "joints sliding freely")
        curves += [
            (at, None, {"color": MUTED, "lw": 0.7, "ls": DASHES[dash], "label": label})
            for at, dash, label in ends
        ]
    else:
        seen = np.concatenate([level.amplitude for level in data.levels])
        near = {m: (m.amplitude >= 0.5 * seen.min()) & (m.amplitude <= 2 * seen.max()) for m in data.modes}
        look = {"color": INK, "lw": 1.1, "ls": DASHES[1]}
        curves += [
            (m.frequency[at], m.amplitude[at], look | {"label": f"backbone, mode {m.number}"})
            for m, at in near.items()
            if m.point == data.point and at.any()
        ]
    plot(ax, "Frequency (Hz)", up, curves, legend="upper right", yscale="log")


def mode_over_amplitude(data: StructureCurves, ax: Axes, mode: ModeCurve, damping: bool) -> None:
    """Draw frequency or damping ratio of a mode over its amplitude."""
    percent = 100 * mode.damping, 100 * mode.damping_error
    values, errors = percent if damping else (mode.frequency, mode.frequency_error)
    look: Any = {"color": PALETTE[0]}
    half = 1.96 * errors
    curves: list[Curve] = [
        *[(mode.amplitude, (values - half, values + half), look | BAND)] * bool(np.any(errors)),
        *_parts(mode.amplitude, values, (mode.tested, look), (~mode.tested, look | UNTESTED)),
        *(
            (slip, None, {"color": MUTED, "lw": 0.8, "ls": dashes, "label": f"{shortened(name, 12)} slips"})
            for name, slip, dashes in zip(data.joints, mode.slips, cycle(DASHES[1:]), strict=False)
            if np.isfinite(slip) and 0 < slip <= mode.amplitude[-1]
        ),
    ]
    what = f"Damping ratio of mode {mode.number} (%)" if damping else f"Frequency of mode {mode.number} (Hz)"
    across = scaled(f"Deflection at {shortened(mode.point, 14)}", mode.amplitude[-1], "m")
    plot(ax, across, what, curves, legend="best", xscale="log", ylim=(0, None) if damping else None)


def _measure(name: str, measure: str, title: str, caption: str) -> Kind:
    return Kind(
        name,
        f"{title} over amplitude",
        f"{caption}; dots: beyond what was tested.",
        fixed(partial(over_amplitude, measure=measure, name=title)),
    )


JOINT_KINDS = by_name(
    _measure(
        "stiffness",
        "secant",
        "Secant stiffness",
        "Stiffness between the ends of the loop under a harmonic motion",
    ),
    _measure("loss", "loss_factor", "Loss factor", "Energy per cycle over 2π times the stored energy"),
    _measure("energy", "energy", "Energy per cycle", "Area of the loop"),
)
STRUCTURE_KINDS = by_name(
    Kind(
        "response",
        "Frequency response by level",
        "First harmonic of the deflection at each level of the force, and the backbone through the peaks. Dashes: "
        "between two folds, where no test stays; dots: beyond what was tested.",
        fixed(partial(over_frequency, receptance=False), when=lambda data: data.levels),
        wide=True,
    ),
    Kind(
        "receptance",
        "Receptance by level",
        "Deflection per force: of a linear structure the levels would be one curve.",
        fixed(partial(over_frequency, receptance=True), when=lambda data: data.levels),
        wide=True,
    ),
    Kind(
        "backbone",
        "Frequency over amplitude",
        "Of each mode; a joint slips from its mark on. Dots: beyond what was tested.",
        lambda data: [partial(mode_over_amplitude, mode=mode, damping=False) for mode in data.modes],
    ),
    Kind(
        "damping",
        "Damping over amplitude",
        "Ratio to critical damping of each mode; a joint slips from its mark on. Dots: beyond what was tested.",
        lambda data: [partial(mode_over_amplitude, mode=mode, damping=True) for mode in data.modes],
    ),
)


def _trust(tested: bool, bands: bool, farthest: str, *, model: bool = True) -> Trust:
    """Return how far curves are those of what was tested, how sure they are, and what to do with them.

    ``farthest`` is the largest amplitude that is drawn; ``model`` says whether one was given.
    """
    return Trust(
        (
            doubt(
                "range",
                "dotted parts lie beyond the amplitudes that were tested" * (not tested),
                "within the amplitudes that were tested",
            ),
            doubt(
                "intervals",
                "the model holds no standard errors: the curves have no bands" * (not bands),
                "the 95 % bands follow from the standard errors of the coefficients",
            ),
        ),
        (
            *[(f"record runs of up to {farthest}", "have what is dotted tested as well")] * (not tested),
            ("sindyjoint export MODEL --to python --out joint", EXPORT[1])
            if model
            else (
                "sindyjoint discover --out results",
                "find the law of a joint, here of a virtual test, and draw these curves with it: --model results",
            ),
        ),
    )


def _joint_tables(result: JointCurves) -> tuple[TextTable, ...]:
    """Return the measures at some amplitudes of each frequency."""
    angle, stiffness = UNITS[result.motion]
    rows = [
        (curve, int(i))
        for curve in result.curves
        # Five rows of a joint's table for each frequency.
        for i in np.unique(np.linspace(0, curve.amplitude.size - 1, 5).round().astype(int))
    ]

    def width(measure: str, unit: str) -> Any:
        return lambda row: amount(
            float(getattr(row[0], measure)[row[1]]),
            unit,
            4,
            1.96 * float(getattr(row[0], f"{measure}_error")[row[1]]),
        )

    return (
        tabulate(
            "curves",
            "With half-widths of the 95 % intervals.",
            rows,
            {
                "Frequency": lambda row: f"{row[0].frequency:.3g} Hz",
                quantities(result.motion).angle: lambda row: amount(float(row[0].amplitude[row[1]]), angle),
                "Secant stiffness": width("secant", stiffness),
                "Loss factor": width("loss_factor", ""),
                "Energy per cycle": width("energy", "J"),
                "Tested": lambda row: "yes" if row[0].tested[row[1]] else "no",
            },
        ),
    )


def _structure_tables(result: StructureCurves) -> tuple[TextTable, ...]:
    """Return the peak of each level, and the course of each mode."""

    def slips_from(mode: ModeCurve) -> str:
        slips = np.where(np.isfinite(mode.slips), mode.slips, np.inf)
        first = int(np.argmin(slips))
        there = 0 < slips[first] < np.inf
        return f"{amount(float(slips[first]), 'm')} ({result.joints[first]})" if there else DASH

    return (
        tabulate(
            "levels",
            "The largest response at each level.",
            result.levels,
            {
                "Force": lambda level: f"{level.force:.3g} N",
                "Peak at": lambda level: f"{level.peak[0]:.4g} Hz",
                "Amplitude": lambda level: amount(
                    level.peak[1], "m", 4, 1.96 * (level.peak[1] * level.peak_error)
                ),
                "Largest joint angle": lambda level: amount(
                    float(level.angle.max()), UNITS[result.motion][0]
                ),
                "Jumps at": lambda level: ", ".join(f"{fold:.4g} Hz" for fold in level.folds) or DASH,
            },
        ),
        tabulate(
            "modes",
            "From the smallest to the largest amplitude.",
            result.modes,
            {
                "Mode": lambda mode: str(mode.number),
                "At": lambda mode: mode.point,
                "Amplitude": lambda mode: " … ".join(amount(float(mode.amplitude[i]), "m") for i in (0, -1)),
                "Frequency": lambda mode: f"{mode.frequency[0]:.4g} … {mode.frequency[-1]:.4g} Hz",
                "Damping": lambda mode: f"{100 * mode.damping[0]:.2g} … {100 * mode.damping[-1]:.2g} %",
                "Slips from": slips_from,
            },
        ),
    )


def _page(
    result: Any, show: Blocks, title: str, kicker: str, said: str, reason: str, *parts: Section
) -> Page:
    found = show.verdict(capital(said)), show.paragraph(reason, "reason")
    return Page(
        f"{result.name}: {title}", kicker, result.name, "", found, (show.warnings(result.warnings),), parts
    )


def _joint_page(result: JointCurves, data: JointCurves, show: Blocks) -> Page:
    """Return how far stiffness and loss change, and all of it."""
    blocks = show.pictures("stiffness", "loss", "energy"), show.tables(*_joint_tables(result))
    return _page(
        result,
        show,
        "stiffness and loss over amplitude",
        "A joint over its amplitude",
        joint_headline(result),
        f"Of the model {result.equation}.",
        section("curves", "Stiffness and loss", "Stiffness and loss", *blocks),
    )


def _structure_page(result: StructureCurves, data: StructureCurves, show: Blocks) -> Page:
    """Return how far the first mode changes, responses and modes."""
    levels, modes = map(show.tables, _structure_tables(result))
    pictures = show.pictures("response", "receptance"), show.pictures("backbone", "damping")
    return _page(
        result,
        show,
        "response and modes over amplitude",
        "A structure over frequency and amplitude",
        structure_headline(result),
        f"The force acts at {result.at}; up to {result.harmonics} harmonics; sticking is exact.",
        section("levels", "Frequency response", "Frequency response", pictures[0], levels),
        section("modes", "Modes over amplitude", "Modes over amplitude", pictures[1], modes),
    )


def _stacked(tables: Sequence[Mapping[str, Any]]) -> str:
    """Return tables of the same columns, one below the other, as CSV."""
    names = tables[0] if tables else ()
    return csv_columns({name: np.concatenate([table[name] for table in tables]) for name in names})


def _joint_files(result: JointCurves, data: JointCurves) -> dict[str, str]:
    """Return all curves as a table, SI units."""
    length, stiffness = (unit.replace("*", "") for unit in UNITS[result.motion])
    units = {"secant": f"_{stiffness}", "storage": f"_{stiffness}", "loss_factor": "", "energy": "_J"}
    tables = [
        {
            "frequency_Hz": np.full(curve.amplitude.size, curve.frequency),
            f"amplitude_{length}": curve.amplitude,
            **{
                f"{name}{end}{units[name]}": values
                for name in MEASURES
                for end, values in zip(
                    ("", "_low95", "_high95"), (getattr(curve, name), *curve.interval95(name)), strict=True
                )
            },
            "tested": curve.tested.astype(int),
        }
        for curve in result.curves
    ]
    return {"curves.csv": _stacked(tables)}


def _structure_files(result: StructureCurves, data: StructureCurves) -> dict[str, str]:
    """Return response and modes as tables, SI units; edges are points of the 95 % band's two edges."""
    quantity = "angle_rad" if result.motion == "rotation" else "elongation_m"
    names = [f"{joint}_{quantity}" for joint in result.joints]
    edges = {
        f"{end}95_{of}": (side, at)
        for end, side in (("low", -1), ("high", 1))
        for at, of in enumerate(("frequency_Hz", "amplitude_m"))
    }
    responses = [
        {
            "force_N": np.full(level.frequency.size, level.force),
            "frequency_Hz": level.frequency,
            "amplitude_m": level.amplitude,
            "phase_deg": np.degrees(level.phase),
            **{name: level.band95(side)[at] for name, (side, at) in edges.items()},
            **dict(zip(names, level.angle, strict=True)),
            "stable": level.stable.astype(int),
            "tested": level.tested.astype(int),
        }
        for level in result.levels
    ]
    modes = [
        {
            "mode": np.full(mode.amplitude.size, mode.number),
            "amplitude_m": mode.amplitude,
            "frequency_Hz": mode.frequency,
            "frequency_error_Hz": mode.frequency_error,
            "damping_ratio": mode.damping,
            "damping_ratio_error": mode.damping_error,
            "force_N": mode.force,
            **dict(zip(names, mode.angle, strict=True)),
            "tested": mode.tested.astype(int),
        }
        for mode in result.modes
    ]
    return {"response.csv": _stacked(responses), "modes.csv": _stacked(modes)}


def joint_headline(result: JointCurves) -> str:
    """Return how far stiffness and loss change over the tested amplitudes, in a sentence."""
    curve, (angle, stiffness) = result.curves[0], UNITS[result.motion]
    within = np.flatnonzero(curve.amplitude <= result.tested_angle)
    last = int(within[-1]) if within.size else curve.amplitude.size - 1
    ends = [amount(float(curve.amplitude[i]), angle) for i in (0, last)]
    small, large = (amount(float(curve.secant[i]), stiffness) for i in (0, last))
    return (
        f"from {ends[0]} to {ends[1]} the secant stiffness goes from {small} to {large}, the loss factor at "
        f"{curve.frequency:.3g} Hz from {curve.loss_factor[0]:.3g} to {curve.loss_factor[last]:.3g}."
    )


def structure_headline(result: StructureCurves) -> str:
    """Return how far the first mode changes, in a sentence."""
    mode = result.modes[0]
    change = 100 * (mode.frequency[-1] / mode.frequency[0] - 1)
    return (
        f"up to {amount(float(mode.amplitude[-1]), 'm')} at {mode.point} mode {mode.number} goes from "
        f"{mode.frequency[0]:.3g} to {mode.frequency[-1]:.3g} Hz ({change:+.2g} %) and its damping reaches "
        f"{100 * mode.damping.max():.2g} %."
    )


JOINT_CURVES = View(
    about=lambda result: escape(f"{result.name}: {joint_headline(result)}"),
    data=JointCurves,
    kind="JointCurves",
    folder="joint-curves",
    kinds=JOINT_KINDS,
    record_file="curves.json",
    question="How stiff is it, and what does it dissipate?",
    headline=lambda result: _trust(
        all(curve.tested.all() for curve in result.curves),
        any(np.any(curve.secant_error) for curve in result.curves),
        amount(max(float(curve.amplitude[-1]) for curve in result.curves), UNITS[result.motion][0]),
    ),
    tables=_joint_tables,
    page=_joint_page,
    files=_joint_files,
)
STRUCTURE_CURVES = View(
    about=lambda result: escape(f"{result.name} (simulated): {structure_headline(result)}"),
    data=StructureCurves,
    kind="StructureCurves",
    folder="structure-curves",
    kinds=STRUCTURE_KINDS,
    record_file="curves.json",
    question="How does it respond?",
    headline=lambda result: _trust(
        all(each.tested.all() for each in (*result.levels, *result.modes)),
        any(np.any(mode.frequency_error) for mode in result.modes),
        f"{amount(max(float(each.amplitude.max()) for each in (*result.levels, *result.modes)), 'm')} "
        f"at {result.point}",
        model=bool(np.isfinite(result.tested).any()),
    ),
    tables=_structure_tables,
    page=_structure_page,
    files=_structure_files,
    # The number of points of each curve.
    details=lambda result: (
        *(f"mode {m.number}: {m.amplitude.size} amplitudes, {m.harmonics} harmonics" for m in result.modes),
        *(f"{f.force:g} N: {f.frequency.size} frequencies, {f.harmonics} harmonics" for f in result.levels),
    ),
)
