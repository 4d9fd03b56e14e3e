"""Every kind of result by its type: what it shows, its figures by name, what is saved and drawn again, its schema."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from pathlib import Path
from textwrap import wrap
from typing import Any

from sindyjoint.described import json_schema
from sindyjoint.documents import kind_of_results, read_json
from sindyjoint.equation.catalogue_file import read_model
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import (
    InputError,
    MissingInputError,
    NothingToDrawError,
    SindyJointError,
    UnknownNameError,
)
from sindyjoint.policy import described, policies
from sindyjoint.reporting.figure import Kind, Panel
from sindyjoint.reporting.style import DOUBLE_COLUMN, Figure, figure_bytes
from sindyjoint.reporting.view import View

# Module and name of each view; the types of what it shows, and marks of what is saved of that. By name: a view needs
# modules that no other does, and is loaded with the first result of its kind.
_SHOWN = {
    "discovery:DISCOVERY": ("Discovery", "ReportData"),
    "verification:REFINEMENT": ("RefinedModel",),
    "verification:VERIFICATION": ("Verification",),
    "diagnosis:DIAGNOSIS": ("Diagnosis", "StructureDiagnosis"),
    "batch:BATCH": ("Batch",),
    "rig:RIG": ("RigMotion", "RigFigures", "Rig"),
    "curves:JOINT_CURVES": ("JointCurves",),
    "curves:STRUCTURE_CURVES": ("StructureCurves",),
    "reproduction:REPRODUCTION": ("Reproduction", "ReproductionFigures"),
    "reproduction:PRINTED": ("PrintedTables",),
    "comparison:COMPARISON": ("Comparison",),
    "changed:CHANGED": ("Change",),
    "check:CAMPAIGN": ("Campaign",),
    "check:CHECK": ("Check", "CheckData"),
    "plan:PLAN": ("Plan",),
    "structure_joints:STRUCTURE_JOINTS": ("RigDiscovery", "StructureFigures", "StructureJoints"),
}
_BY_NAME = {name: view for view, names in _SHOWN.items() for name in names}
#: Folders of results within a folder of another kind, in the order of the links between their pages.
FOLDERS = (
    "discovery", "refinement", "verification", "diagnosis", "batch", "rig", "joint-curves", "structure-curves",
    "reproduction", "comparison", "check", "structure",
)  # fmt: skip


@cache
def _load_view(place: str) -> View:
    module, _, name = place.partition(":")
    return getattr(import_module(f"sindyjoint.reporting.results.{module}"), name)


def _marks(view: View) -> tuple[str, ...]:
    """Return the marks of what is saved of a kind of result, those of earlier versions too."""
    return () if view.data is None else (view.kind, *view.formerly)


def view_of(result: Any) -> View:
    """Return the view of a result: that of its type before those of its bases; of one that was stopped, of its check.

    Raises
    ------
    TypeError
        If it is no result.
    """
    stopped = getattr(result, "stopped", None)
    return view_of_type(result if stopped is None else stopped)


def view_of_type(result: Any) -> View:
    """Return the view of a result by its type, whatever became of it.

    Raises
    ------
    TypeError
        If it is no result.
    """
    for kind in type(result).__mro__:
        if kind.__name__ in _BY_NAME and kind.__module__.startswith("sindyjoint."):
            return _load_view(_BY_NAME[kind.__name__])
    raise TypeError(f"{type(result).__name__} is no result; known are {', '.join(_BY_NAME)}")


def kinds_of(result: Any) -> Mapping[str, Kind]:
    """Return the kinds of figure that belong to a result, in the words of its kind of motion."""
    view = view_of(result)
    return view.figures(view.gather(result))


def drawable(result: Any, parts: bool = False) -> list[str]:
    """Return the kinds that a result can show; with ``parts``, single panels too."""
    data = view_of(result).gather(result)
    return [name for name, kind in kinds_of(data).items() if (parts or not kind.part) and kind.panels(data)]


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

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> found = sindyjoint.discover(test, "paper", correct=False)
    >>> figure = sindyjoint.draw("loops", found)
    >>> len(figure.axes) > 0
    True
    """
    view, data, made, panels = panels_of(kind, result)
    return view.draw(made, panels, data, width)


def panels_of(kind: str, result: Any) -> tuple[View, Any, Kind, list[Panel]]:
    """Return the view of a result, its data, a kind of its figures and the panels of that.

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
    return view, data, kinds[kind], panels


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
    for f in getattr(getattr(result, "soundness", None), "findings", ()):
        where = " of ".join(part for part in (f.channel, f.run) if part) or "all runs"
        said = f"{f.severity}: {f.id} ({where}): {f.extent}; {f.effect}; {f.remedy}"
        yield from wrap(said, 110, subsequent_indent="  ")
    known = policies()
    for name in (*view.judged_by(result), "shared"):
        if name in known:
            limits = ", ".join(f"{each.name} {each.quantity}" for each in described(known[name]))
            yield from wrap(f"policy of {name}: {limits}", 110, subsequent_indent="  ")


DATA_FILE = "figures/data.json"


def saved_text(result: Any) -> str:
    """Return what is saved of a result as the text of ``figures/data.json``."""
    view = view_of(result)
    return json.dumps(view.save(view.gather(result)), ensure_ascii=False, separators=(",", ":"))


def list_saved(path: str | os.PathLike[str]) -> dict[str, Path]:
    """Return the folders of results within a folder, that of its own first, by the names of their kinds.

    Parameters
    ----------
    path : path
        A folder that a command wrote with ``--out``, or the ``model.json`` in it.
    """
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    own = kind_of_results(folder)
    places = {own: folder} | {name: folder / name for name in FOLDERS if name != own}
    return {name: place for name, place in places.items() if (place / DATA_FILE).is_file()}


def load_results(path: str | os.PathLike[str]) -> Any:
    """Return what a command saved for figures.

    Parameters
    ----------
    path : path
        The folder of results, or the ``model.json`` in it.

    Returns
    -------
    ReportData, Verification, Diagnosis, Comparison, Batch, ReproductionFigures or RigFigures

    Raises
    ------
    MissingInputError
        If there is no such folder or file, or it holds no data for figures.
    NothingToDrawError
        If the folder holds a model without data for figures.
    InputError
        If the data cannot be read, or belong to another model than the one in the same folder.

    Examples
    --------
    >>> import sindyjoint
    >>> motion = sindyjoint.rig_motion("pulse-rig")
    >>> folder = motion.report("results")
    >>> figure = sindyjoint.draw(motion.figures[0], sindyjoint.load_results(folder))
    >>> len(figure.axes) > 0
    True
    """
    given = Path(path)
    if not given.exists():
        raise MissingInputError(
            f"{str(given)!r} does not exist; expected a folder that a command wrote with --out"
        )
    folder = given if given.is_dir() else given.parent
    saved = folder / DATA_FILE
    model_file = folder / "model.json"
    if not saved.is_file():
        message = (
            f"{str(folder)!r} holds no {DATA_FILE}, from which figures are drawn; run discover, compare, verify, "
            "diagnose or reproduce again, with --out and the name of a folder"
        )
        if model_file.is_file():
            read_model(model_file)  # that of a bare model is no fault, unless it cannot be read
            raise NothingToDrawError(message)
        raise MissingInputError(message)
    try:
        with drawing(saved):
            result = _from_record(read_json(saved))
    except InputError as error:
        text = str(error)
        raise InputError(text if str(saved) in text else f"{str(saved)!r}: {text}") from None
    if isinstance(getattr(result, "model", None), JointModel) and model_file.is_file():
        # As text: a noise floor that is not known is NaN, which equals nothing.
        if read_model(model_file).to_json() != result.model.to_json():
            raise InputError(
                f"{str(saved)!r} belongs to another model than {str(model_file)!r}; run the command with --out again"
            )
    return result


@contextmanager
def drawing(path: str | os.PathLike[str]) -> Iterator[None]:
    """Say of data that were changed, so that their parts no longer fit together, whose they are.

    Raises
    ------
    InputError
        If drawing from what was read at a path fails within the block.
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
        if isinstance(error, SindyJointError):
            raise
        raise InputError(
            f"the data for figures of {str(path)!r} do not fit together ({' '.join(str(error).split()):.80}); run the "
            "command with --out again"
        ) from error


def _from_record(record: Any) -> Any:
    kind = record.get("kind") if isinstance(record, dict) else None
    view = _load_view(_BY_NAME[kind]) if isinstance(kind, str) and kind in _BY_NAME else None
    if view is None or kind not in _marks(view):
        known = dict.fromkeys(mark for place in _SHOWN for mark in _marks(_load_view(place)))
        raise InputError(f"not a saved result: 'kind' is {kind!r}; expected one of {', '.join(known)}")
    return view.restore(record)


# Where the record of each stands; a manifest is checked by pydantic, all others describe themselves.
_RECORDS = {
    "campaign": "files.manifest:Manifest",
    "model": "equation.model:JointModel",
    "test": "equation.test_record:TestNuisances",
    "plan": "planning.plan:Plan",
    "check": "soundness.check:Check",
    "discovery": "judgement.discovery:Discovery",
    "comparison": "judgement.comparison:Comparison",
    "verification": "workflows.verify:RefinedModel",
    "diagnosis": "diagnosis.result:Diagnosis",
    "rig": "workflows.simulate:RigMotion",
    "joint-curves": "substructure.joint_curves:JointCurves",
    "structure-curves": "substructure.forced:StructureCurves",
    "export": "export:Export",
    "simulation": "workflows.simulate:WrittenTest",
    "batch": "workflows.joints.summary:Batch",
    "joint": "workflows.joints:CampaignRecord",
    "changed": "judgement.changed:Change",
    "structure": "judgement.rig_discovery:RigDiscovery",
    "reproduction": "workflows.reproduce:Reproduction",
    "tables": "judgement.paper_tables:PrintedTables",
}


def record_schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a result file.

    Parameters
    ----------
    name : str
        One of :func:`record_names`.

    Raises
    ------
    UnknownNameError
        For another name.
    """
    if name not in _RECORDS:
        raise UnknownNameError(f"schema of {name!r}; expected one of {', '.join(_RECORDS)}")
    module, _, kind = _RECORDS[name].partition(":")
    record = getattr(import_module(f"sindyjoint.{module}"), kind)
    return record.model_json_schema() if name == "campaign" else json_schema(record)


def record_names() -> tuple[str, ...]:
    """Return the names of what has a schema."""
    return tuple(_RECORDS)
