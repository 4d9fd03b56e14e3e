"""Every kind of result by its type: what it offers, and its figures by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from sindyjoint.errors import UnknownNameError
from sindyjoint.policy import Limit, described, policies
from sindyjoint.reporting.figures.kind import Kind
from sindyjoint.reporting.results.batch import BatchView
from sindyjoint.reporting.results.campaign import CampaignView
from sindyjoint.reporting.results.changed import ChangeView
from sindyjoint.reporting.results.check import CheckView, wrap_findings
from sindyjoint.reporting.results.comparison import ComparisonView
from sindyjoint.reporting.results.curves import JointCurvesView, StructureCurvesView
from sindyjoint.reporting.results.diagnosis import DiagnosisView
from sindyjoint.reporting.results.discovery import DiscoveryView
from sindyjoint.reporting.results.plan import PlanView
from sindyjoint.reporting.results.reproduction import ReproductionView
from sindyjoint.reporting.results.rig import RigView
from sindyjoint.reporting.results.structure_joints import StructureJointsView
from sindyjoint.reporting.results.verification import RefinementView, VerificationView
from sindyjoint.reporting.style import DOUBLE_COLUMN, figure_bytes
from sindyjoint.reporting.view import View
from sindyjoint.soundness.check import Check

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VIEWS: tuple[View[Any, Any], ...] = (
    DiscoveryView(),
    # Before that of a verification, as which it is saved.
    RefinementView(),
    VerificationView(),
    DiagnosisView(),
    BatchView(),
    RigView(),
    JointCurvesView(),
    StructureCurvesView(),
    ReproductionView(),
    ComparisonView(),
    ChangeView(),
    CampaignView(),
    CheckView(),
    PlanView(),
    StructureJointsView(),
)
_BY_TYPE = {kind: view for view in VIEWS for kind in view.results}
#: Views of what is saved, by the mark in the file, that of an earlier version too.
SAVED = {kind: view for view in VIEWS if view.data is not None for kind in (view.kind, *view.formerly)}


FOLDERS = tuple(dict.fromkeys(view.folder for view in VIEWS if view.folder))


def view_of(result: Any) -> View[Any, Any]:
    """Return the view of a result: that of its type before those of its bases; of one that was stopped, of its check.

    Raises
    ------
    TypeError
        If it is no result.
    """
    return _BY_TYPE[Check] if getattr(result, "stopped", None) is not None else view_of_type(result)


def view_of_type(result: Any) -> View[Any, Any]:
    """Return the view of a result by its type, whatever became of it.

    Raises
    ------
    TypeError
        If it is no result.
    """
    for kind in type(result).__mro__:
        if kind in _BY_TYPE:
            return _BY_TYPE[kind]
    raise TypeError(
        f"{type(result).__name__} is no result; known are {', '.join(k.__name__ for k in _BY_TYPE)}"
    )


def kinds_of(result: Any) -> Mapping[str, Kind]:
    """Return the kinds of figure that belong to a result, in the words of its kind of motion."""
    view = view_of(result)
    return view.figures(view.gather(result))


def drawable(result: Any, parts: bool = False) -> list[str]:
    """Return the kinds that a result can show; with ``parts``, single panels too."""
    view = view_of(result)
    data = view.gather(result)
    return [
        name for name, kind in view.figures(data).items() if (parts or not kind.part) and kind.panels(data)
    ]


def draw(kind: str, result: Any, width: float = DOUBLE_COLUMN) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    kind : str
        One of those that :func:`kinds_of` gives for the result.
    result : Discovery, Verification, Diagnosis, Comparison, Batch, Reproduction, RigMotion, or what was saved of one
    width : float
        Inches; below 5 the panels stand one under the other.

    Returns
    -------
    matplotlib Figure
        Free of any global state.

    Raises
    ------
    UnknownNameError
        For an unknown kind, or one that the result cannot show.
    """
    view = view_of(result)
    data = view.gather(result)
    kinds = view.figures(data)
    if kind not in kinds:
        near = get_close_matches(kind, kinds, 1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise UnknownNameError(f"figure {kind!r} is not known; {hint}expected one of {', '.join(kinds)}")
    panels = kinds[kind].panels(data)
    if not panels:
        raise UnknownNameError(
            f"figure {kind!r} has nothing to show here; one of {', '.join(drawable(data))} has"
        )
    return view.draw(kinds[kind], panels, data, width)


def draw_all(result: Any) -> dict[str, bytes]:
    """Return every figure that a result can show, as SVG by kind."""
    data = view_of(result).gather(result)
    return {kind: figure_bytes(draw(kind, data), "svg") for kind in drawable(data)}


def show(result: Any) -> None:
    """Print a result for a person."""
    view_of(result).show(result)


def details(result: Any) -> Iterator[str]:
    """Yield the numbers behind a result, and the policies that decided it, as lines: what ``--verbose`` adds."""
    view = view_of(result)
    yield from view.details(result)
    soundness = getattr(result, "soundness", None)
    if soundness is not None:
        yield from wrap_findings(soundness)
    known = policies()
    for name in view.judges_of(result):
        if name in known:
            limits = ", ".join(f"{item.name} {_with_unit(item)}" for item in described(known[name]))
            yield from wrap(f"policy of {name}: {limits}", 110, subsequent_indent="  ")


def _with_unit(item: Limit) -> str:
    return f"{item.value}" if item.unit == "1" else f"{item.value} {item.unit}"
