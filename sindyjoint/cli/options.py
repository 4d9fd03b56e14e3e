"""Options that several commands share, declared once; defaults are those of the functions that are called."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sindyjoint.cli.answer import Interrupted, Output, Progress
from sindyjoint.errors import refuse

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel


def given(**options: Any) -> dict[str, Any]:
    """Return the options that were given: the others keep the defaults of the function that is called."""
    return {name: value for name, value in options.items() if value is not None and value != []}


METHODS = (
    "stlsq", "best_subset", "backward", "coefficient_stlsq", "sr3", "ssr", "frols", "ensemble", "lasso_lars",
)  # fmt: skip
"""Ways to make the path of models, as discovery has them."""

CampaignPath = Annotated[
    Path | None,
    typer.Argument(
        metavar="CAMPAIGN",
        help="campaign.toml or its folder. Without it: the built-in virtual test of the inter-panel joint.",
        show_default=False,
    ),
]
CandidatesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--library",
        "-l",
        help="Candidate terms: name or path of a catalogue. Repeatable. [extended]",
    ),
]
AlignOption = Annotated[
    bool,
    typer.Option(
        "--align",
        help="Remove the time delay between the channels, also where the law leaves more than noise.",
    ),
]
AcceptOption = Annotated[
    list[str] | None,
    typer.Option(
        "--accept", metavar="ID", help="Finding of the check of the data that shall not stop. Repeatable."
    ),
]
AtOption = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        metavar="INPUT=VALUE",
        help="Value of an input of the law, in its declared unit: temperature=-40. May be repeated; an input that is "
        "not given is at its reference.",
        show_default=False,
    ),
]

# A scheme, a host, a port: what Dask takes for the address of a scheduler.
_ADDRESS = re.compile(r"((tcp|tls|ucx|ws|wss)://)?[^\s/:]+(:[^\s/:]+)*:\d{1,5}/?")


def _check_jobs(jobs: int) -> int:
    if jobs < 1 and jobs != -1:
        raise typer.BadParameter(f"{jobs} is neither a positive number nor -1")
    return jobs


def _check_address(address: str | None) -> str | None:
    if address is not None and not _ADDRESS.fullmatch(address):
        raise typer.BadParameter(f"{address!r} is no address of a scheduler, such as tcp://10.0.0.7:8786")
    return address


JobsOption = Annotated[
    int,
    typer.Option(
        "--jobs", "-j", callback=_check_jobs, help="Processes of this machine; -1: one for each core."
    ),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Start a Dask cluster of so many processes on this machine.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", callback=_check_address, help="Address of a running Dask scheduler to work on."
    ),
]


@dataclass(frozen=True)
class Work:
    """Where tasks run: the options of every command that has many."""

    jobs: JobsOption = 1
    workers: WorkersOption = None
    cluster: ClusterOption = None


@dataclass(frozen=True)
class Finding:
    """How terms are found: the options of every command that finds them."""

    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"How the path of models is made: {', '.join(METHODS)}; or pysindy:NAME for an optimizer of pysindy.",
        ),
    ] = "stlsq"
    selection: Annotated[
        Literal["evidence", "one_standard_error"], typer.Option(help="How one model of the path is chosen.")
    ] = "evidence"
    threshold: Annotated[
        float | None,
        typer.Option(help="Least unique share of a term, instead of choosing by evidence."),
    ] = None
    require: Annotated[
        list[str] | None, typer.Option("--require", help="Id of a term to keep. Repeatable.")
    ] = None
    forbid: Annotated[
        list[str] | None, typer.Option("--forbid", help="Id of a term to leave out. Repeatable.")
    ] = None
    states: Annotated[
        Literal["auto", "periodic", "broadband"], typer.Option(help="How rates are made of angles.")
    ] = "auto"
    bandwidth: Annotated[float | None, typer.Option(help="Highest frequency kept in the angle, Hz.")] = None
    align: AlignOption = False

    def arguments(self) -> dict[str, Any]:
        """Return what :func:`sindyjoint.discover` takes."""
        return {
            "method": self.method,
            "selection": self.selection,
            "threshold": self.threshold,
            "forced": tuple(self.require or ()),
            "forbidden": tuple(self.forbid or ()),
            "states": self.states,
            "bandwidth": self.bandwidth,
            "align": self.align,
        }


# Each is one parameter of a command and several options of the command line.
BLOCKS = (Finding, Output, Progress, Work)


def with_blocks(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the fields of the :data:`BLOCKS` among its parameters as options, where those parameters stand.

    What shows its stages does so from before its first import to its end.
    """
    blocks: dict[str, tuple[Callable[..., Any], list[str]]] = {}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        if parameter.annotation in BLOCKS:
            options = inspect.signature(parameter.annotation, eval_str=True).parameters
            blocks[parameter.name] = parameter.annotation, list(options)
            parameters += options.values()
        else:
            parameters.append(parameter)

    def with_options(**given: Any) -> None:
        made = {
            name: block(**{option: given.pop(option) for option in options})
            for name, (block, options) in blocks.items()
        }
        shown = next((block for block in made.values() if isinstance(block, Progress)), None)
        if shown is None:
            return command(**made, **given)
        try:
            shown.begin()
            command(**made, **given)
        # Where a class is made, Python 3.11 makes another error of Ctrl-C.
        except Exception as error:
            if shown.interrupted and not isinstance(error, Interrupted):
                raise KeyboardInterrupt from None
            raise
        finally:
            shown.end()

    with_options.__name__, with_options.__doc__ = command.__name__, command.__doc__
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    # An option without a default may follow one that has one: typer passes all by name.
    by_name = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters]
    with_options.__signature__ = inspect.Signature(by_name)  # type: ignore[attr-defined]
    return with_options


def refuse_other_options(context: typer.Context, taken: Collection[str], reason: str) -> None:
    """Refuse the first option on the command line that is not taken in this use of a command."""
    for name in context.params.keys() - taken:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise typer.BadParameter(reason, param_hint=f"--{name.replace('_', '-')}")


def given_inputs(model: JointModel, given: Sequence[str] | None) -> dict[str, float]:
    """Return the values that options give inputs of a model, SI.

    Raises
    ------
    InputError, UnknownNameError
        For text that is no such value, or a name that is no input.
    """
    from sindyjoint.equation.model_parts import input_values
    from sindyjoint.files.campaign import value_in

    known, values = {each.name: each for each in model.inputs}, split_pairs(given)
    input_values(model, dict.fromkeys(values, 0.0))
    return {name: value_in(known[name], value, f"--at {name}") for name, value in values.items()}


def split_pairs(
    given: Sequence[str] | None, option: str = "--at", expected: str = "INPUT=VALUE, such as temperature=-40"
) -> dict[str, str]:
    """Return the text of each value that options give, by its name.

    Raises
    ------
    InputError
        For text that gives none.
    """
    pairs = [(text, *text.partition("=")[::2]) for text in given or ()]
    refuse((not value.strip(), f"{option} {text!r}: expected {expected}") for text, _, value in pairs)
    return {name.strip(): value.strip() for _, name, value in pairs}
