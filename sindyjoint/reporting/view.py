"""What every kind of result offers, once: its record, tables, figures, page, lines, and what is kept of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from sindyjoint.judgement.headline import is_of_the_paper
from sindyjoint.reporting.packing import pack, unpack
from sindyjoint.reporting.page import Blocks, markup, provenance, render, section
from sindyjoint.reporting.style import SINGLE_COLUMN, figure_bytes
from sindyjoint.reporting.tables import findings_table, print_table, terminal
from sindyjoint.text import in_words_of, in_words_of_origin, spelled

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from sindyjoint.reporting.figure import Kind, Panel
    from sindyjoint.reporting.page import Page, Provenance
    from sindyjoint.reporting.tables import TextTable
    from sindyjoint.trust import Light, Trust

NAMES = 8  # characters
TRUST, NEXT = "Can I trust it?", "What next?"
MARKS = {"good": ("green", "ok"), "fair": ("yellow", "mind"), "poor": ("red", "no")}
# The policies by which terms are found.
FINDING = ("states", "equation", "discovery", "soundness", "workflows")

R = TypeVar("R")
D = TypeVar("D")


class View(Generic[R, D]):
    """How one kind of result is shown, drawn, written, and read again.

    A result (R) is what a workflow returned. Its data (D) are what figures are drawn from and what is saved with
    them: of most results the result itself, of others a small part. A subclass states its attributes as keywords of
    its definition.

    Attributes
    ----------
    data : type
        Of the data; ``None`` where nothing is saved and drawn.
    kind : str
        What saved data of this kind are marked with.
    folder : str
        Name of this kind among the results of one folder, and of its own folder within where another kind came first.
    formerly : mapping of str to mapping
        Marks of earlier versions, and the fields that each of them stands for.
    kinds : mapping of str to Kind
        Its figures.
    record_file : str
        The file that :meth:`to_dict` is written to; empty: none.
    judged_by : tuple of str
        The policies that decided it, by their names in :func:`sindyjoint.policy.policies`.
    question : str
        What the result answers, on a terminal and on its page.
    records_key : str
        The list in :meth:`to_dict` that is a data frame's rows; empty: the first table is.
    unsaved : mapping of str to object
        Fields of the data that no figure needs, and what stands for each when they are read again.
    renamed : mapping of str to str
        Fields of the data that are saved under another name.
    """

    data: ClassVar[type | None] = None
    kind: ClassVar[str] = ""
    folder: ClassVar[str] = ""
    formerly: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    kinds: ClassVar[Mapping[str, Kind]] = {}
    record_file: ClassVar[str] = ""
    judged_by: ClassVar[tuple[str, ...]] = ()
    question: ClassVar[str] = "What is it?"
    records_key: ClassVar[str] = ""
    unsaved: ClassVar[Mapping[str, Any]] = {}
    renamed: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, **facts: Any) -> None:
        super().__init_subclass__()
        for name, value in facts.items():
            setattr(cls, name, value)

    # ---- the record, its tables and rows

    def to_dict(self, result: R) -> dict[str, Any]:
        """Return everything that is known, as JSON data."""
        record: dict[str, Any] = result.to_dict(full=True)  # type: ignore[attr-defined]
        return record

    def tables(self, result: R) -> tuple[TextTable, ...]:
        """Return the tables that people read, in order."""
        return ()

    def records(self, result: R) -> list[dict[str, Any]]:
        """Return the rows of a data frame: what :meth:`to_dict` says of each part, numbers as numbers."""
        if self.records_key:
            return [_flat(record) for record in self.to_dict(result)[self.records_key]]
        tables = self.tables(result)
        return [dict(zip(table.columns, row, strict=True)) for table in tables[:1] for row in table.rows]

    def files(self, result: R, data: Any) -> dict[str, str]:
        """Return the texts that are written in addition to page, record and figures, by name of file."""
        return {}

    def judges_of(self, result: R) -> tuple[str, ...]:
        """Return which of the policies decided a result."""
        return self.judged_by

    def simulated(self, result: Any) -> bool:
        """Return whether what a result, or its data, rest on comes from a virtual test."""
        said: bool = getattr(result, "simulated", False)
        warnings = getattr(result, "warnings", ())
        return bool(said) or any("simulated" in text and "not measured" in text for text in warnings)

    def headline(self, result: R) -> Trust | None:
        """Return whether to trust a result and what to do next; None for what no such question is asked of."""
        return None

    # ---- figures, and the data that are kept for them

    def drawn_from(self, result: R) -> Any:
        """Return what the figures of a result are drawn from."""
        return result

    def gather(self, result: Any) -> Any:
        """Return the data of a result as they are read again, so that a figure is the same later; of data, the data."""
        if self.data is None or isinstance(result, self.data):
            return result
        return self.restore(self.save(self.drawn_from(result)))

    def kinds_of(self, data: Any) -> Mapping[str, Kind]:
        """Return the figures that belong to some data."""
        return self.kinds

    def figures(self, data: Any) -> Mapping[str, Kind]:
        """Return the kinds of figure of this kind of result, in the words of its kind of motion and of its origin."""
        joint = getattr(getattr(data, "model", None), "joint", None)
        motion, virtual = getattr(joint, "motion", "rotation"), self.simulated(data)
        of_paper = is_of_the_paper(str(getattr(joint, "name", getattr(data, "joint", ""))))
        crosses = " Crosses: the paper's tables." if of_paper else ""
        return {
            name: replace(
                kind,
                title=in_words_of_origin(virtual, in_words_of(motion, kind.title)),
                caption=in_words_of_origin(
                    virtual, in_words_of(motion, kind.caption.replace("{crosses}", crosses))
                ),
            )
            for name, kind in self.kinds_of(data).items()
        }

    def draw(self, kind: Kind, panels: Sequence[Panel], data: Any, width: float) -> Figure:
        """Return panels of a kind of figure as a figure of a width in inches, in words of the origin of the data."""
        from sindyjoint.reporting.figure import drawn

        figure = drawn(kind, panels, data, width)
        if self.simulated(data):
            from matplotlib.text import Text

            for text in figure.findobj(Text):
                text.set_text(in_words_of_origin(True, text.get_text()))
        return figure

    def kept(self, data: Any) -> Any:
        """Return what is saved of the data: no more samples than a picture shows."""
        return data

    def save(self, data: Any) -> dict[str, Any]:
        """Return data as plain JSON data."""
        record = pack(self.kept(data), self.unsaved)
        return {**{self.renamed.get(name, name): value for name, value in record.items()}, "kind": self.kind}

    def restore(self, record: Mapping[str, Any]) -> Any:
        """Return data from what :meth:`save` made of them.

        Raises
        ------
        InputError
            If it is something else; the message names the field.
        """
        if isinstance(record, Mapping):
            record = {**self.formerly.get(str(record.get("kind")), {}), **record}
            record |= {name: record.get(saved) for name, saved in self.renamed.items()}
        return unpack(self.data, record, self.unsaved)

    # ---- the page

    def page(self, result: R, data: Any, show: Blocks, folder: Path | None) -> Page:
        """Return what the page says; ``folder`` is where it will stand, for links to what lies there."""
        raise NotImplementedError

    def hero(
        self, show: Blocks, data: Any, name: str, panel: int = 0, caption: str = "", again: bool = False
    ) -> str:
        """Return one panel of a figure for the first screen; of a figure's only one, whether it stands below again."""
        kind = self.figures(data)[name]
        panels = kind.panels(data)
        if not panels:
            return ""
        drawn = figure_bytes(self.draw(kind, [panels[panel]], data, SINGLE_COLUMN), "svg")
        return show.hero(name, drawn, caption, whole=len(panels) == 1 and not again)

    def origin(self, result: R, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return where a result came from."""
        return provenance(getattr(result, "campaign", None), seed, command_line, files)

    def html(
        self,
        result: R,
        data: Any,
        origin: Provenance,
        pictures: Mapping[str, bytes],
        folder: Path | None = None,
    ) -> str:
        """Return the report as one HTML text, from its figures as SVG by kind."""
        show = Blocks(self.figures(data), pictures)
        page = self.page(result, data, show, folder)
        soundness = getattr(result, "soundness", None)
        if soundness is not None and soundness.findings and "findings" not in {s.id for s in page.sections}:
            accepted = ", ".join(map(spelled, soundness.accepted))
            said = f"The verdict is: {soundness.verdict}." + (f" Accepted: {accepted}." if accepted else "")
            more = markup("{} Every channel with the findings marked: <code>sindyjoint check</code>.").format(
                said
            )
            blocks = show.paragraph(more), show.table(findings_table(soundness.findings))
            page = replace(
                page, sections=(*page.sections, section("data", "Are the data sound?", "", *blocks))
            )
        return render(page, origin, self.simulated(result))

    # ---- the terminal

    def about(self, result: R) -> str:
        """Return the first line on a terminal: what this is a result of; with markup."""
        return ""

    def show(self, result: R) -> None:
        """Print the result for a person: whether to trust it, what it is, what to do next."""
        from rich.markup import escape

        console, headline = terminal(), self.headline(result)
        console.print(self.about(result))
        if headline is not None:
            colour, _ = MARKS[headline.colour]
            console.print(f"\n[bold]{TRUST}[/] [{colour}]{headline.answer}[/]")
            _print_lights(headline.lights, console)
            console.print(f"\n[bold]{self.question}[/]")
            _print_lights(headline.question, console)
        self.show_result(result, console)
        for warning in self.warnings(result):
            console.print(f"- {escape(warning)}")
        if headline is not None:
            console.print(f"\n[bold]{NEXT}[/]")
            for step in headline.advised:
                # Commands in one line each, to be copied.
                console.print(f"  {escape(step.do)}  [dim]to {escape(step.to)}[/]", soft_wrap=True)

    def show_result(self, result: R, console: Console) -> None:
        """Print what the result is: its tables."""
        for table in self.tables(result):
            if table.rows:
                console.print()
                print_table(table.headed(), console)
        console.print()

    def warnings(self, result: Any) -> Sequence[str]:
        """Return what to be aware of, for the end."""
        texts: Sequence[str] = result.warnings
        return texts

    def details(self, result: R) -> Iterator[str]:
        """Yield the numbers behind it as lines: what ``--verbose`` adds."""
        return iter(())


def _print_lights(lights: Sequence[Light], console: Console) -> None:
    """Print reasons, one a line."""
    from rich.markup import escape

    wide = max([NAMES, *(len(light.name) for light in lights)])
    for light in lights:
        colour, mark = MARKS[light.colour]
        console.print(f"  [{colour}]{mark:<4}[/] {light.name:<{wide}}  {escape(light.sentence)}")


def _flat(record: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a nested record with one name for each value; of a list, the ends of an interval or the items as text."""
    flat: dict[str, Any] = {}
    for name, value in record.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        elif name == "interval95":
            flat |= {f"{prefix}interval95_low": value[0], f"{prefix}interval95_high": value[1]}
        else:
            flat[f"{prefix}{name}"] = ", ".join(map(str, value)) if isinstance(value, list) else value
    return flat
