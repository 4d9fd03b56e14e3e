"""Many campaigns: each discovered by itself and written as it is done, then all of them held against each other."""

import inspect
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sindyjoint.discovery import Evidence, evidence_bytes
from sindyjoint.documents import SUMS, changed_files, sums_of, sums_text
from sindyjoint.equation.catalogue import as_catalogue
from sindyjoint.errors import (
    InputError,
    MissingInputError,
    OutputError,
    SindyJointError,
    WorkerError,
    checks_options,
)
from sindyjoint.files.atomic import (
    check_output,
    hold_folder,
    prepare_output,
    settle,
    whole_folder,
    write_text,
)
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.numeric import seed_of
from sindyjoint.parallel import executor
from sindyjoint.soundness.check import check_accepted
from sindyjoint.states import check_bandwidth
from sindyjoint.workflows.discover import discover, regressor_options
from sindyjoint.workflows.joints import (
    CAMPAIGNS,
    FACTORS_FILE,
    MODEL_FILE,
    RECORD_FILE,
    REQUIRED,
    CampaignRecord,
    Task,
    Writer,
    broken,
    changed_outputs,
    extras_of,
    find_tasks,
    fingerprint,
    last_result,
    read_record,
)
from sindyjoint.workflows.joints.summary import Batch, summarised


@checks_options(lambda: (*inspect.signature(discover).parameters, *regressor_options()))
def batch(
    campaigns: str | Path | Sequence[str | Path],
    out: str | Path,
    library: Any = "extended",
    *,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    write: Writer | None = None,
    progress: Callable[[str], None] | None = None,
    on_record: Callable[[CampaignRecord], None] | None = None,
    **options: Any,
) -> Batch:
    """Discover the joints of many campaigns and compare them.

    Each campaign has a folder ``out/campaigns/ID`` that appears whole when it is done: the model, its factors, and a
    record with a hash of what it was made from. A second call on the same folder keeps what is done and unchanged,
    so a batch that was interrupted, or killed, goes on where it was. A campaign that cannot be used is recorded as
    broken and stops nothing; the files of an earlier result stay in its folder.

    Parameters
    ----------
    campaigns : path, pattern, or sequence of these
        A folder is searched for every ``campaign.toml`` below it; a pattern such as ``"tests/*-cold"`` names
        folders or manifests.
    out : path
        Folder of results.
    library : str, Path, Catalogue, or sequence of these
    jobs, workers, cluster
        Where to run; see :func:`~sindyjoint.parallel.executor`. The result is the same to the last digit.
    write : callable, optional
        ``write(discovery, folder)`` puts further files into a campaign's folder; its attribute ``extras``, a sequence
        of str, names what it writes. Those of an earlier call that still hold are kept, requested or not.
    progress : callable, optional
        Called with one line as each campaign ends.
    on_record : callable, optional
        Called with each :class:`~sindyjoint.workflows.joints.CampaignRecord` as it ends.
    **options
        Of :func:`~sindyjoint.workflows.discover.discover`. Of ``rng`` each campaign has the same seed.

    Returns
    -------
    Batch

    Raises
    ------
    MissingInputError
        If there is no campaign.
    InputError, UnknownNameError, OutputError
        For options that no campaign can be discovered with, or a folder that cannot be written, or that another batch
        is writing into.

    Examples
    --------
    >>> import sindyjoint
    >>> for joint in ("inter-panel", "panel-root"):
    ...     test = sindyjoint.simulate(joint, frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, out=f"tests/{joint}")
    >>> sindyjoint.batch("tests", "results", "paper", correct=False)
    <Batch: 2 campaigns: 2 with a model, all of them simulated>
    """
    check_output(out)
    if "rng" in options:
        options["rng"] = None if options["rng"] is None else seed_of(options["rng"])
    tasks = find_tasks(campaigns, Path(out), library, options, write)
    _check_options(library, options)
    records: dict[int, CampaignRecord] = {}
    kept = 0
    with ExitStack() as stack:
        # Before there is a folder: a cluster that does not answer leaves none.
        workers_here = stack.enter_context(executor(jobs, workers, cluster))
        folder = prepare_output(Path(out) / CAMPAIGNS)
        # The hold on it ends with the process.
        if stack.enter_context(hold_folder(folder)) is False:
            raise OutputError(
                f"another batch is writing into {str(folder.parent)!r}; wait for it to end, or give another --out"
            )
        for number, answer in workers_here(run_task, tasks):
            lost = isinstance(answer, WorkerError)
            record, fresh = (_recorded_broken(tasks[number], str(answer)), True) if lost else answer
            kept += not fresh
            records[number] = record
            if on_record is not None:
                on_record(record)
            if progress is not None:
                progress(f"campaigns: {len(records)} of {len(tasks)}")
    return summarised(tuple(records[number] for number in range(len(tasks))), folder, kept)


def _check_options(library: Any, options: Mapping[str, Any]) -> None:
    """Refuse here, once, what would make every campaign a broken one."""
    from sindyjoint.discovery.regression import TermRegression

    catalogue = as_catalogue(library)
    given = {name: options[name] for name in options if name in TermRegression.parameters()}
    TermRegression(catalogue, **given).check_parameters()
    for term in {*given.get("forced", ()), *given.get("forbidden", ())} - {*catalogue.ids, "inertia"}:
        _ = catalogue[term]
    check_bandwidth(options.get("bandwidth"))
    check_accepted(options.get("accept", ()))


def run_task(task: Task) -> tuple[CampaignRecord, bool]:
    """Do one campaign, or find that it is done.

    Returns
    -------
    record : CampaignRecord
    fresh : bool
        Whether it was done now.
    """
    inputs = ""
    try:
        inputs = fingerprint(task.manifest, task.options, task.library, version("sindyjoint"))
        if not task.folder.exists():
            settle(task.folder)
        last = last_result(task.folder)
        if last is not None and (last.inputs != inputs or changed_outputs(last, task.folder)):
            last = None
        if last is not None and set(extras_of(task)) <= set(last.extras):
            _record(last, task.folder)
            return last, False
        return _recorded(task, discover(task.manifest, task.library, **task.options), inputs, last), True
    # One campaign must not take the others down, whatever it does to the libraries that read it.
    except Exception as error:
        return _recorded_broken(task, error, inputs), True


def _record(record: CampaignRecord, folder: Path) -> None:
    """Write a record into a campaign's folder, unless it is there."""
    path, text = folder / RECORD_FILE, record.to_json()
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        write_text(path, text)


def _recorded(task: Task, result: Discovery, inputs: str, last: CampaignRecord | None) -> CampaignRecord:
    """Write what was found of a campaign, with what the last result of the same inputs has more; return the record."""
    evidence = result.regressor.evidence_ if result.stopped is None else Evidence((), ())
    joint = result.campaign.joint
    # An input that is the same in all runs distinguishes this joint from the others.
    held = [
        (each.name, each.unit, each.tested[0])
        for each in result.campaign.inputs
        if each.tested is not None and each.tested[0] == each.tested[1]
    ]
    with whole_folder(task.folder) as stage:
        (stage / MODEL_FILE).write_text(result.model.to_json() + "\n", encoding="utf-8", newline="\n")
        (stage / FACTORS_FILE).write_bytes(evidence_bytes(evidence))
        if task.write is not None:
            task.write(result, stage)
        for name in last.outputs if last is not None else ():
            if not (stage / name).exists():
                (stage / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(task.folder / name, stage / name)
        (stage / SUMS).unlink(
            missing_ok=True
        )  # of what was written beyond the model; the list of all follows
        outputs = sums_of(stage)
        if missing := REQUIRED - set(outputs):
            raise OutputError(
                f"{', '.join(sorted(missing))} vanished from {str(stage)!r}; run the batch again"
            )
        record = CampaignRecord(
            id=task.id,
            manifest=task.label,
            status="found" if result.found else "none",
            reason=result.reason,
            joint={
                "name": joint.name,
                "motion": joint.motion,
                "inertia": joint.inertia,
                "temperature": joint.temperature,
                "serial": joint.serial,
                "labels": dict(joint.labels),
                **({"inputs": {name: value for name, _, value in held}} if held else {}),
                **({"input_units": {name: unit for name, unit, _ in held}} if held else {}),
            },
            result=result.to_dict(),
            inputs=inputs,
            outputs=outputs,
            extras=sorted({*extras_of(task), *(last.extras if last is not None else ())}),
        )
        (stage / RECORD_FILE).write_text(record.to_json(), encoding="utf-8", newline="\n")
        (stage / SUMS).write_text(sums_text(outputs), encoding="utf-8", newline="\n")
    return record


def _recorded_broken(task: Task, fault: BaseException | str, inputs: str = "") -> CampaignRecord:
    """Write that an attempt failed, and why, next to the files of an earlier result, of which none is touched."""
    record = broken(task.id, task.label, fault, inputs)
    last = last_result(task.folder)
    if last is not None:
        reason = (
            f"{record.reason}; the files of its earlier result are kept, and not compared with the others"
        )
        record = replace(record, reason=reason, earlier=asdict(last))
    try:
        _record(record, prepare_output(task.folder))
    except (SindyJointError, OSError) as error:
        return replace(record, reason=f"{record.reason}; and its record cannot be written: {error}")
    return record


def verify_batch(
    campaigns: str | Path | Sequence[str | Path],
    out: str | Path,
    library: Any = "extended",
    *,
    write: Writer | None = None,
    **options: Any,
) -> tuple[tuple[str, str], ...]:
    """Hold a finished batch against its inputs and its hashes; nothing is written.

    Parameters are those of :func:`batch`.

    Returns
    -------
    tuple of (str, str)
        Campaign, and what keeps its result from being taken for done: files missing or changed, inputs, options,
        catalogue or version other than those it was made from. An empty name stands for the batch itself.

    Raises
    ------
    MissingInputError
        If there is no campaign, or no batch.
    """
    if not any((Path(out) / name).exists() for name in (SUMS, CAMPAIGNS)):
        raise MissingInputError(
            f"{str(out)!r} holds no batch; expected the folder that batch wrote with --out"
        )
    tasks = find_tasks(campaigns, Path(out), library, options, write)
    faults = [(task.id, fault) for task in tasks for fault in _find_faults(task)]
    try:
        faults += [("", fault) for fault in changed_files(Path(out))]
    except InputError as error:
        faults.append(("", str(error)))
    return tuple(faults)


def _find_faults(task: Task) -> list[str]:
    """Return what keeps the result of a campaign from being taken for done."""
    if not task.folder.exists():
        return ["has no result there: run the batch again, without --verify-only"]
    try:
        record = read_record(task.folder)
        if record.status == "broken":
            return [f"broken: {record.reason}"]
        inputs = fingerprint(task.manifest, task.options, task.library, version("sindyjoint"))
    except SindyJointError as error:
        return [str(error)]
    missing = sorted(set(extras_of(task)) - set(record.extras))
    return [
        *changed_outputs(record, task.folder),
        *["was made from other files, options, catalogue or version"] * (record.inputs != inputs),
        *[f"has no {', '.join(missing)}"] * bool(missing),
    ]
