"""Results saved for drawing again: ``figures/data.json`` in every folder of results."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from sindyjoint.batch.summary import Batch
from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.diagnosis.structure.gap import RecordGap
from sindyjoint.diagnosis.structure.result import StructureDiagnosis
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, MissingInputError
from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.packing import pack, unpack
from sindyjoint.reporting.reproduction_figures import ReproductionFigures
from sindyjoint.reporting.rig_motion import RigFigures
from sindyjoint.response.verification import Band, RunVerification, Verification
from sindyjoint.workflows.comparison import Comparison

T = TypeVar("T")

DATA_FILE = "figures/data.json"
# More samples of a response than these no picture shows.
KEPT_SAMPLES = 6000


def _nothing(_: Any) -> None:
    """Stand for a field that is not saved: no figure needs it."""


READERS: dict[str, Callable[[Any], Any]] = {
    "ReportData": ReportData.from_dict,
    "Verification": lambda data: unpack(Verification, data, model=JointModel.from_dict),
    "Diagnosis": lambda data: unpack(
        Diagnosis, data, model=JointModel.from_dict, effects=lambda _: (), whole=lambda _: None
    ),
    "Batch": lambda data: unpack(Batch, data),
    "Rig": lambda data: unpack(RigFigures, data),
    "Reproduction": lambda data: unpack(ReproductionFigures, data),
    "StructureDiagnosis": lambda data: unpack(
        StructureDiagnosis, data, model=JointModel.from_dict, effects=lambda _: (), whole=lambda _: None
    ),
    "Comparison": lambda data: unpack(Comparison, data, discovery=_nothing, left_out=lambda _: {}),
}


def saved_text(
    result: ReportData | Verification | Diagnosis | Comparison | Batch | ReproductionFigures | RigFigures,
) -> str:
    """Return a result as the text of ``figures/data.json``."""
    if isinstance(result, ReportData):
        record = result.to_dict()
    elif isinstance(result, Batch):
        # Each campaign's own result lies in its own folder.
        records = tuple(replace(record, result=None, earlier=None) for record in result.records)
        record = {"kind": "Batch", **pack(replace(result, records=records))}
    elif isinstance(result, ReproductionFigures):
        record = {"kind": "Reproduction", **pack(result)}
    elif isinstance(result, RigFigures):
        record = {"kind": "Rig", **pack(result)}
    elif isinstance(result, Comparison):
        record = {"kind": "Comparison", **pack(result, skip=("discovery", "left_out"))}
    else:
        if isinstance(result, StructureDiagnosis):
            result = replace(result, records=tuple(map(_thinned_record, result.records)))
        # As model.json has it.
        model = getattr(result, "whole", None) or result.model
        record = {**pack(result, skip=("model", "effects", "whole")), "model": model.to_dict()}
        record["kind"] = type(result).__name__
        if isinstance(result, Verification):
            record["subject_kind"] = result.kind
    return json.dumps(record, ensure_ascii=False, separators=(",", ":"))


def thinned(result: Verification) -> Verification:
    """Return a verification with no more samples than a picture shows."""
    return replace(result, runs=tuple(_thinned(run) for run in result.runs))


def _thinned(run: RunVerification) -> RunVerification:
    step = -(-run.time.size // KEPT_SAMPLES)
    band = run.band and Band(run.band.low[::step], run.band.high[::step], run.band.draws, run.band.failed)
    simulated = None if run.simulated is None else run.simulated[::step]
    return replace(run, time=run.time[::step], measured=run.measured[::step], simulated=simulated, band=band)


def _thinned_record(record: RecordGap) -> RecordGap:
    step = -(-record.time.size // KEPT_SAMPLES)
    before, after = (None if x is None else x[::step] for x in (record.before, record.after))
    return replace(
        record, time=record.time[::step], measured=record.measured[::step], before=before, after=after
    )


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
    InputError
        If the data cannot be read, or belong to another model than the one that lies beside them.
    """
    given = Path(path)
    if not given.exists():
        raise MissingInputError(
            f"{str(given)!r} does not exist; a folder that a command wrote with --out is wanted"
        )
    folder = given if given.is_dir() else given.parent
    saved = folder / DATA_FILE
    if not saved.is_file():
        raise MissingInputError(
            f"{str(folder)!r} holds no {DATA_FILE}, from which figures are drawn; run discover, compare, verify, "
            "diagnose or reproduce again, with --out and the name of a folder"
        )
    result = _read(saved, _from_record)
    beside = folder / "model.json"
    if isinstance(getattr(result, "model", None), JointModel):
        model = _read(beside, JointModel.from_dict)
        # As text: a noise floor that is not known is NaN, which equals nothing.
        if model.to_json() != result.model.to_json():
            raise InputError(
                f"{str(saved)!r} belongs to another model than {str(beside)!r}; run the command with --out again"
            )
    return result


def _from_record(record: Any) -> Any:
    kind = record.get("kind") if isinstance(record, dict) else None
    if kind not in READERS:
        raise InputError(f"not a saved result: 'kind' is {kind!r}; one of {', '.join(READERS)} is wanted")
    if kind == "Verification":
        record = {**record, "kind": record.get("subject_kind")}
    return READERS[kind](record)


def _read(path: Path, reader: Callable[[Any], T]) -> T:
    """Read a JSON file; errors name it."""
    try:
        return reader(json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise MissingInputError(f"cannot read {str(path)!r}: {error.strerror or error}") from None
    except RecursionError:
        raise InputError(f"{str(path)!r}: nested too deeply to be a result") from None
    except ValueError as error:
        reason = str(error) if isinstance(error, InputError) else f"not JSON ({error})"
        raise InputError(f"{str(path)!r}: {reason}") from None
