"""What every kind of result offers, once: its record, tables, figures, page, lines, and what is kept of it."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from sindyjoint.errors import InputError
from sindyjoint.judgement import is_of_the_paper
from sindyjoint.plain import fields_of, to_plain
from sindyjoint.reporting.figure import Kind, Panel, drawn
from sindyjoint.reporting.page import Blocks, Page, Provenance, markup, render, section
from sindyjoint.reporting.style import SINGLE_COLUMN, Figure, figure_bytes
from sindyjoint.reporting.tables import (
    Console,
    TextTable,
    escape,
    findings_table,
    json_text,
    print_table,
    terminal,
)
from sindyjoint.text import in_words_of, in_words_of_origin, spelled
from sindyjoint.trust import Light, Trust

TRUST, NEXT = "Can I trust it?", "What next?"
MARKS = {"good": ("green", "ok"), "fair": ("yellow", "mind"), "poor": ("red", "no")}
# The policies by which terms are found.
FINDING = ("states", "equation", "discovery", "soundness")


def _said_simulated(result: Any) -> bool:
    """Return whether a result says that it, or its data, come from a virtual test."""
    told = any("simulated" in text and "not measured" in text for text in getattr(result, "warnings", ()))
    return bool(getattr(result, "simulated", False)) or told


def listed(tables: Iterable[TextTable]) -> Iterator[Any]:
    """Yield the tables that have rows, apart from each other."""
    for table in tables:
        if table.rows:
            yield from ("", table.headed())
    yield ""


@dataclass(frozen=True)
class View:
    """How one kind of result is shown, drawn, written, and read again.

    A result is what a workflow returned. Its data are what figures are drawn from and what is saved with them: of most
    results the result itself, of others a small part.

    Parameters
    ----------
    about : callable
        Result → the first line on a terminal: what this is a result of; with markup.
    data : type, optional
        Of the data; nothing is saved and drawn without it.
    kind : str
        What saved data of this kind are marked with; ``formerly`` are the marks of earlier versions, and the fields
        that each of them stands for.
    folder : str
        Name of this kind among the results of one folder, and of its own folder within where another kind came first.
    kinds : mapping of str to Kind, or callable
        Its figures; of some data.
    tables : callable
        Result → the tables that people read, in order.
    page : callable, optional
        Result, data, blocks → what the page says.
    headline : callable
        Result → whether to trust it and what to do next; None for what no such question is asked of.
    question : str
        What the result answers, on a terminal and on its page.
    printed : callable, optional
        Result, console → what is printed of the result, part by part: texts with markup, and tables; by default these.
    warnings, details : callable
        Result → what to be aware of, for the end; the numbers behind it as lines, what ``--verbose`` adds.
    files : callable
        Result, data → the texts that are written in addition to page, record and figures, by name of file.
    inputs : callable
        Result → files that it was made from, beside its campaign, which ``campaign`` gives, and its ``seed``.
    record_file : str
        The file of the result's record; empty: none.
    judged_by : callable
        Result → the policies that decided it, by their names in :func:`sindyjoint.policy.policies`.
    rows : str or callable
        The list in the record that is a data frame's rows, or what gives them; empty: the first table is.
    drawn_from, kept : callable
        Result → data; data → what is saved of them, no more samples than a picture shows.
    unsaved, renamed, marks : mapping
        Fields of the data that no figure needs, and what stands for each when they are read again; fields that are
        saved under another name; what is saved beside them.
    simulated : callable
        Result, or its data → whether what it rests on comes from a virtual test.
    """

    about: Callable[[Any], str] = lambda result: ""
    data: type | None = None
    kind: str = ""
    formerly: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    folder: str = ""
    kinds: Mapping[str, Kind] | Callable[[Any], Mapping[str, Kind]] = field(default_factory=dict)
    tables: Callable[[Any], tuple[TextTable, ...]] = lambda result: ()
    page: Callable[[Any, Any, Blocks], Page] | None = None
    headline: Callable[[Any], Trust | None] = lambda result: None
    question: str = "What is it?"
    printed: Callable[[Any, Console], Iterable[Any]] | None = None
    warnings: Callable[[Any], Sequence[str]] = lambda result: result.warnings
    details: Callable[[Any], Iterable[str]] = lambda result: ()
    files: Callable[[Any, Any], dict[str, str]] = lambda result, data: {}
    campaign: Callable[[Any], Any] = lambda result: getattr(result, "campaign", None)
    inputs: Callable[[Any], Sequence[Path]] = lambda result: ()
    seed: Callable[[Any, object], object] = lambda result, given: given
    record_file: str = ""
    judged_by: Callable[[Any], tuple[str, ...]] = lambda result: ()
    rows: str | Callable[[Any], list[dict[str, Any]]] = ""
    record: Callable[[Any], Any] = lambda result: result
    drawn_from: Callable[[Any], Any] = lambda result: result
    kept: Callable[[Any], Any] = lambda data: data
    unsaved: Mapping[str, Any] = field(default_factory=dict)
    renamed: Mapping[str, str] = field(default_factory=dict)
    marks: Mapping[str, Any] = field(default_factory=dict)
    simulated: Callable[[Any], bool] = _said_simulated

    # ---- the record and its rows

    def records(self, result: Any) -> list[dict[str, Any]]:
        """Return the rows of a data frame: what the record says of each part, numbers as numbers."""
        if not isinstance(self.rows, str):
            return self.rows(result)
        if self.rows:
            return [_flat(record) for record in self.record(result).to_dict(full=True)[self.rows]]
        return [
            dict(zip(table.columns, row, strict=True))
            for table in self.tables(result)[:1]
            for row in table.rows
        ]

    def texts(self, result: Any, data: Any) -> dict[str, str]:
        """Return what is written in addition to page and figures, by name of file: the record, and further files."""
        record = (
            {self.record_file: json_text(self.record(result).to_dict(full=True))} if self.record_file else {}
        )
        return self.files(result, data) | record

    # ---- figures, and the data that are kept for them

    def gather(self, result: Any) -> Any:
        """Return the data of a result as they are read again, so that a figure is the same later; of data, the data."""
        if self.data is None or isinstance(result, self.data):
            return result
        return self.restore(self.save(self.drawn_from(result)))

    def figures(self, data: Any) -> Mapping[str, Kind]:
        """Return the kinds of figure of this kind of result, in the words of its kind of motion and of its origin."""
        joint = getattr(getattr(data, "model", None), "joint", None)
        motion, virtual = getattr(joint, "motion", "rotation"), self.simulated(data)
        of_paper = is_of_the_paper(str(getattr(joint, "name", getattr(data, "joint", ""))))
        crosses = " Crosses: the paper's tables." if of_paper else ""

        def said(text: str) -> str:
            return in_words_of_origin(virtual, in_words_of(motion, text.replace("{crosses}", crosses)))

        kinds = self.kinds if isinstance(self.kinds, Mapping) else self.kinds(data)
        return {n: replace(k, title=said(k.title), caption=said(k.caption)) for n, k in kinds.items()}

    def draw(self, kind: Kind, panels: Sequence[Panel], data: Any, width: float) -> Figure:
        """Return panels of a kind of figure as a figure of a width in inches, in words of the origin of the data."""
        figure = drawn(kind, panels, data, width)
        if self.simulated(data):
            from matplotlib.text import Text

            for text in figure.findobj(Text):
                text.set_text(in_words_of_origin(True, text.get_text()))
        return figure

    @property
    def layout(self) -> dict[str, str]:
        """Fields of the data that are saved, by the names under which they are."""
        assert self.data is not None
        names = (each.name for each in fields(self.data) if each.name not in self.unsaved)
        return {self.renamed.get(name, name): name for name in names}

    def save(self, data: Any) -> dict[str, Any]:
        """Return data as plain JSON data."""
        kept = self.kept(data)
        saved = to_plain({key: getattr(kept, name) for key, name in self.layout.items()}, digits=6)
        return {**self.marks, **saved, "kind": self.kind}

    def restore(self, record: Mapping[str, Any]) -> Any:
        """Return data from what :meth:`save` made of them.

        Raises
        ------
        InputError
            If it is something else; the message names the field.
        """
        if isinstance(record, Mapping):
            record = {**self.formerly.get(str(record.get("kind")), {}), **record}
        assert self.data is not None
        try:
            return self.data(**fields_of(self.data, record, self.layout), **self.unsaved)
        except InputError as error:
            raise InputError(f"not a saved {self.data.__name__}: {error}") from None

    # ---- the page

    def panel(self, data: Any, name: str, place: int) -> tuple[bytes, bool]:
        """Return a panel of a figure as an SVG for the first screen, and whether it is all of the figure."""
        kind = self.figures(data)[name]
        panels = kind.panels(data)
        svg = figure_bytes(self.draw(kind, [panels[place]], data, SINGLE_COLUMN), "svg") if panels else b""
        return svg, len(panels) == 1

    def html(
        self,
        result: Any,
        data: Any,
        origin: Provenance,
        pictures: Mapping[str, bytes],
        folder: Path | None = None,
    ) -> str:
        """Return the report as one HTML text, from its figures as SVG by kind."""
        assert self.page is not None
        show = Blocks(self.figures(data), pictures, partial(self.panel, data), folder)
        page, headline = self.page(result, data, show), self.headline(result)
        found = (
            page.found
            if headline is None
            else (show.answers(headline, self.question, page.hero, page.found),)
        )
        sections, soundness = [*page.sections], getattr(result, "soundness", None)
        if soundness is not None and soundness.findings and "findings" not in {s["id"] for s in sections}:
            accepted = ", ".join(map(spelled, soundness.accepted))
            said = f"The verdict is: {soundness.verdict}." + (f" Accepted: {accepted}." if accepted else "")
            more = markup("{} Every channel with the findings marked: <code>sindyjoint check</code>.")
            blocks = show.paragraph(more.format(said)), show.table(findings_table(soundness.findings))
            sections.append(section("data", "Are the data sound?", "", *blocks))
        page = replace(page, lead=(*page.first, *found, *page.lead), sections=sections)
        return render(page, origin, self.simulated(result))

    # ---- the terminal

    def show(self, result: Any) -> None:
        """Print the result for a person: whether to trust it, what it is, what to do next."""
        console, headline = terminal(), self.headline(result)
        console.print(self.about(result))
        if headline is not None:
            colour, _ = MARKS[headline.colour]
            console.print(f"\n[bold]{TRUST}[/] [{colour}]{headline.answer}[/]")
            _print_lights(headline.lights, console)
            console.print(f"\n[bold]{self.question}[/]")
            _print_lights(headline.question, console)
        for part in self.printed(result, console) if self.printed else listed(self.tables(result)):
            if isinstance(part, TextTable):
                print_table(part, console)
            else:
                console.print(part)
        for warning in self.warnings(result):
            console.print(f"- {escape(warning)}")
        if headline is not None:
            console.print(f"\n[bold]{NEXT}[/]")
            for step in headline.advised:
                # Commands in one line each, to be copied.
                console.print(f"  {escape(step.do)}  [dim]to {escape(step.to)}[/]", soft_wrap=True)


def _print_lights(lights: Sequence[Light], console: Console) -> None:
    """Print reasons, one a line."""
    wide = max([8, *(len(light.name) for light in lights)])
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
