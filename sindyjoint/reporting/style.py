"""How figures look: palette, sizes, SI prefixes, and figures without global state."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeAlias

from sindyjoint.text import superscript

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

Axes: TypeAlias = "matplotlib.axes.Axes"
Figure: TypeAlias = "matplotlib.figure.Figure"

# Okabe and Ito (2008): distinct with every common colour blindness. Black is reserved for the model.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
# Grey printing takes the colours away: dashes and markers carry the same distinction.
DASHES = (
    "-",
    (0, (5, 1.5)),
    (0, (1.2, 1.2)),
    (0, (5, 1.2, 1.2, 1.2)),
    (0, (2.5, 1)),
    (0, (7, 1, 1, 1, 1, 1)),
)
INK, MUTED, RULE, ACCENT = "#1b1f24", "#5b6570", "#d5dae0", "#D55E00"
# One shade per step, dark to light, ordered in grey too.
SEQUENTIAL, DIVERGING = "cividis", "RdBu_r"

# Ink and paper upon colours that stay as they are when a page turns dark; INK and white would turn with it.
FIXED_INK, FIXED_PAPER = "#1b1f25", "#fefefe"

SINGLE_COLUMN, DOUBLE_COLUMN = 3.5, 7.0  # inch

_RC: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 8,
    "axes.linewidth": 0.7,
    "axes.prop_cycle": None,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    # A fixed place: to look for one, matplotlib measures every tick label again.
    "axes.titley": 1.0,
    "axes.titlepad": 5.0,
    "axes.titlesize": 8,
    "axes.formatter.limits": (-3, 5),
    "font.size": 8,
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.1,
    "mathtext.fontset": "dejavusans",
    "svg.fonttype": "path",
    "svg.hashsalt": "sindyjoint",
    "text.color": INK,
    # Hinted text has another width at every resolution: what was laid out at one would be cut off at another.
    "text.hinting": "none",
    "xtick.color": INK,
    "xtick.labelsize": 7,
    "xtick.minor.pad": 5.0,
    "ytick.color": INK,
    "ytick.labelsize": 7,
    "ytick.minor.pad": 5.0,
}

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
# Fonts that hold letters which the built-in one lacks; whichever of them the machine has.
_OTHER_SCRIPTS = (
    "Noto Sans CJK SC",
    "Noto Sans CJK JP",
    "Microsoft YaHei",
    "PingFang SC",
    "Hiragino Sans GB",
    "WenQuanYi Zen Hei",
    "Noto Sans",
    "Arial Unicode MS",
)


def pretty_unit(unit: str) -> str:
    """Return a unit for people.

    Examples
    --------
    >>> pretty_unit("N*m/rad^2")
    'N·m/rad²'
    """
    text = re.sub(r"(?:\^|\*\*)(-?\d+)", lambda found: superscript(found[1]), unit)
    return re.sub(r"\bdeg([CF])\b", r"°\1", text.replace("*", "·"))


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Return the number to multiply by, and the unit with the prefix under which the largest lies between 0.3 and 300.

    Examples
    --------
    >>> prefixed(7.7e-4, "rad")
    (1000.0, 'mrad')
    >>> prefixed(2e-5, "rad")
    (1000000.0, 'µrad')
    >>> prefixed(5.2, "N*m")
    (1.0, 'N·m')
    """
    size = abs(largest)
    if not (size > 0 and size < float("inf")) or unit in ("", "1"):
        return 1.0, pretty_unit(unit)
    factor, prefix = next((known for known in _PREFIXES if size >= 0.3 * known[0]), _PREFIXES[-1])
    return float(f"{1 / factor:g}"), prefix + pretty_unit(unit)


def amount(value: float, unit: str, digits: int = 3, half: float = 0.0) -> str:
    """Return a number with its unit, prefixed to its size, and half the width of its interval where it has one.

    Examples
    --------
    >>> amount(0.0005, "J")
    '0.5 mJ'
    """
    factor, shown = prefixed(value, unit)
    width = f" ± {half * factor:.2g}" if half > 0 else ""
    return f"{value * factor:.{digits}g}{width} {shown}".rstrip()


def plain(text: object) -> str:
    """Return text that matplotlib draws as it stands: no mathematics, no control characters."""
    shown = "".join(char if char.isprintable() or char == "\n" else "\ufffd" for char in str(text))
    return shown.replace("$", r"\$")


def shortened(text: object, length: int = 28) -> str:
    """Return at most ``length`` characters, the middle left out."""
    shown = str(text)
    if len(shown) <= length:
        return shown
    head = (length - 1) // 2
    return f"{shown[:head]}…{shown[-(length - 1 - head) :]}"


@cache
def _fonts() -> list[str]:
    """Return the fonts to draw with: matplotlib's first, so that a picture is the same everywhere."""
    from matplotlib.font_manager import fontManager

    installed = {font.name for font in fontManager.ttflist}
    return ["DejaVu Sans", *(name for name in _OTHER_SCRIPTS if name in installed)]


# Matplotlib's settings and its parser of formulas are shared by all threads.
_DRAWING = RLock()


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the project's style within the block, whatever the caller's matplotlib settings are."""
    import matplotlib
    from cycler import cycler

    settings: Any = {**_RC, "axes.prop_cycle": cycler(color=PALETTE), "font.family": _fonts()}
    with _DRAWING, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(settings)
        with warnings.catch_warnings():
            # A run may be named in a script that no installed font holds; an empty box says so in the picture.
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            yield


def legend_above(ax: Axes, lines: int, columns: int = 1) -> None:
    """Put the legend into the upper left corner and make room for its lines above what is drawn."""
    low, high = ax.get_ylim()
    panel = ax.get_window_extent().height * 72 / ax.figure.dpi
    # A line, and the frame, in points.
    taken = min((10.0 * lines + 4.0) / panel, 0.6)
    share = taken / (1 - taken)
    log = ax.get_yscale() == "log"
    ax.set_ylim(low, high * (high / low) ** share if log else high + share * (high - low))
    ax.legend(loc="upper left", ncols=columns, borderaxespad=0.2, labelspacing=0.3, columnspacing=1)


# In the metadata of every figure: a figure of ours may be replaced.
NAME = "sindyjoint"


def figure_bytes(figure: Figure, kind: str, dpi: int = 300) -> bytes:
    """Return a drawn figure as bytes; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
    kind : {"svg", "pdf", "png"}
    dpi : int
        Of a PNG.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> found = sindyjoint.discover(test, "paper", correct=False)
    >>> svg = sindyjoint.figure_bytes(sindyjoint.draw("loops", found), "svg")
    >>> svg[:5]
    b'<?xml'
    """
    buffer = io.BytesIO()
    with drawing_style():
        if kind == "svg":
            from matplotlib.backends.backend_svg import FigureCanvasSVG

            # savefig would draw it twice.
            FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": NAME})
        else:
            metadata: dict[str, Any] = (
                {"CreationDate": None, "Creator": NAME} if kind == "pdf" else {"Software": NAME}
            )
            figure.savefig(buffer, format=kind, dpi=dpi, metadata=metadata)
    return buffer.getvalue()
