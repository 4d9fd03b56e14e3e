"""Joints inside a structure: what ``sindyjoint discover`` and ``sindyjoint simulate`` do with a rig."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.cli.answer import answer, call, write
from sindyjoint.cli.options import Output
from sindyjoint.cli.progress import Progress

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel
    from sindyjoint.mechanics.transient import Response
    from sindyjoint.workflows.simulate import WrittenTest

# Of the options of a search those that belong to the channels of a joint's own test.
OF_CHANNELS = ("states", "bandwidth", "align")


def discover_structure(
    rig: Path,
    out: Path | None,
    output: Output,
    progress: Progress,
    seed: int | None,
    options: Mapping[str, Any],
) -> bool:
    """Find the laws of the joints inside a structure, and write those of each kind into a folder of its own."""
    chosen = {name: value for name, value in options.items() if name not in OF_CHANNELS}
    find = call("workflows.discover:discover_rig", rig, progress=progress.say, **chosen)
    result = answer(find, out, output, progress, seed, subject=rig)
    if out is not None:
        from sindyjoint.reporting.results.structure_joints import place_of_law

        for law in result.laws:
            if law.discovery is not None:
                write(law.discovery, out / place_of_law(law), progress, seed, force=output.force)
    return result.found


def models_of(rig: Path, given: Path) -> JointModel | dict[str, JointModel]:
    """Return the model of a file for every joint, or those by kind in a folder that ``discover RIG --out`` wrote."""
    from sindyjoint.equation.model_file import read_model
    from sindyjoint.mechanics.rig_test_file import load_rig_test
    from sindyjoint.reporting.results.structure_joints import place_of_kind

    kinds = dict.fromkeys(load_rig_test(rig).kinds)
    folders = {kind: given / place_of_kind(kind) for kind in kinds}
    if all((folder / "model.json").is_file() for folder in folders.values()):
        return {kind: read_model(folder) for kind, folder in folders.items()}
    return read_model(given)


def simulate_structure(
    rig: Path, model: Path | None, out: Path, format: str, seed: int, force: bool, progress: Progress
) -> WrittenTest:
    """Make and write a virtual test of a rig; return what was written.

    A model stands in the joints whose law is "model"; where one moves beyond what that was tested to, stderr says so.
    """
    import typer

    from sindyjoint.equation.model_file import read_model
    from sindyjoint.errors import InputError
    from sindyjoint.mechanics.rig_test_file import load_rig_plan
    from sindyjoint.mechanics.rig_test_writing import write_rig_test
    from sindyjoint.mechanics.virtual_rig import virtual_rig_test
    from sindyjoint.response.model_law import model_law
    from sindyjoint.response.verify_rig import joint_range_warnings
    from sindyjoint.workflows.simulate import WrittenRun, WrittenTest

    known = None if model is None else read_model(model)
    warnings: list[str] = []
    laws = {} if known is None else {"model": model_law(known)}
    plan = load_rig_plan(rig, laws)
    modelled = [h.name for h in plan.test.structure.hinges if h.law is laws.get("model")]
    if known is not None and not modelled:
        raise InputError(
            f'{rig}: --model is given, and no joint is a place for it; write law = "model" for the joints that '
            "it stands for, or leave it out"
        )

    def seen(run: str, response: Response) -> None:
        if known is not None:
            warnings.extend(f"{run}: {line}" for line in joint_range_warnings(known, response, modelled))

    progress.say(f"simulating {len(plan.drives)} runs")
    test = virtual_rig_test(plan.test, plan.drives, plan.recorder, seed, seen)
    progress.say("writing the files")
    manifest = write_rig_test(rig, test, out, format, force)
    progress.end()
    for line in warnings:
        typer.echo(line, err=True)
    runs = tuple(WrittenRun(run.name, run.frequency, run.level, run.drive.size) for run in test.runs)
    return WrittenTest(manifest, test.name, runs)
