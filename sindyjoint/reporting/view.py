"""What every kind of result offers, once: its record, tables, figures, page, lines, and what is kept of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from sindyjoint.reporting.packing import pack, unpack
from sindyjoint.reporting.text_table import terminal
from sindyjoint.reporting.trust import print_lights, print_next_steps, print_trust
from sindyjoint.text import in_words_of, in_words_of_origin

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from sindyjoint.reporting.figures.kind import Kind, Panel
    from sindyjoint.reporting.provenance import Provenance
    from sindyjoint.reporting.text_table import TextTable
    from sindyjoint.trust import Trust

# The policies by which terms are found.
FINDING = ("states", "equation", "discovery", "bias", "soundness", "workflows")

R = TypeVar("R")
D = TypeVar("D")


class View(Generic[R, D]):
    """How one kind of result is shown, drawn, written, and read again.

    A result (R) is what a workflow returned. Its data (D) are what figures are drawn from and what is saved with
    them: of most results the result itself, of others a small part.

    Attributes
    ----------
    results : tuple of type
        What it shows. For a subclass of one of them that has a view, that view holds.
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
    template : str
        Of its page.
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

    results: ClassVar[tuple[type, ...]] = ()
    data: ClassVar[type | None] = None
    kind: ClassVar[str] = ""
    folder: ClassVar[str] = ""
    formerly: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    kinds: ClassVar[Mapping[str, Kind]] = {}
    template: ClassVar[str] = ""
    record_file: ClassVar[str] = ""
    judged_by: ClassVar[tuple[str, ...]] = ()
    question: ClassVar[str] = "What is it?"
    records_key: ClassVar[str] = ""
    unsaved: ClassVar[Mapping[str, Any]] = {}
    renamed: ClassVar[Mapping[str, str]] = {}

    def gather(self, result: Any) -> Any:
        """Return what the figures of a result are drawn from; of data, the data."""
        return result

    def to_dict(self, result: R) -> dict[str, Any]:
        """Return everything that is known, as JSON data."""
        record: dict[str, Any] = result.to_dict(full=True)  # type: ignore[attr-defined]
        return record

    def records(self, result: R) -> list[dict[str, Any]]:
        """Return the rows of a data frame: what :meth:`to_dict` says of each part, numbers as numbers."""
        if self.records_key:
            return [_flat(record) for record in self.to_dict(result)[self.records_key]]
        tables = self.tables(result)
        return [dict(zip(table.columns, row, strict=True)) for table in tables[:1] for row in table.rows]

    def tables(self, result: R) -> tuple[TextTable, ...]:
        """Return the tables that people read, in order."""
        return ()

    def kinds_of(self, data: Any) -> Mapping[str, Kind]:
        """Return the figures that belong to some data."""
        return self.kinds

    def judges_of(self, result: R) -> tuple[str, ...]:
        """Return which of the policies decided a result."""
        return self.judged_by

    def simulated(self, result: Any) -> bool:
        """Return whether what a result, or its data, rest on comes from a virtual test."""
        said: bool = getattr(result, "simulated", False)
        warnings = getattr(result, "warnings", ())
        return bool(said) or any("simulated" in text and "not measured" in text for text in warnings)

    def figures(self, data: Any) -> Mapping[str, Kind]:
        """Return the kinds of figure of this kind of result, in the words of its kind of motion and of its origin."""
        joint = getattr(getattr(data, "model", None), "joint", None)
        motion, virtual = getattr(joint, "motion", "rotation"), self.simulated(data)
        return {
            name: replace(
                kind,
                title=in_words_of_origin(virtual, in_words_of(motion, kind.title)),
                caption=in_words_of_origin(virtual, in_words_of(motion, kind.caption)),
            )
            for name, kind in self.kinds_of(data).items()
        }

    def lead(self, result: R, data: Any) -> tuple[str, int] | None:
        """Return which figure, and which of its panels, stands first on the page; None where the template says so."""
        return None

    def draw(self, kind: Kind, panels: Sequence[Panel], data: Any, width: float) -> Figure:
        """Return panels of a kind of figure as a figure of a width in inches, in words of the origin of the data."""
        from sindyjoint.reporting.figures.kind import drawn

        figure = drawn(kind, panels, data, width)
        if self.simulated(data):
            from matplotlib.text import Text

            for text in figure.findobj(Text):
                text.set_text(in_words_of_origin(True, text.get_text()))
        return figure

    def content(self, result: R, data: Any, folder: Path | None) -> dict[str, Any]:
        """Return what the page's template needs in addition to result, tables, figures and origin."""
        raise NotImplementedError

    def page(
        self,
        result: R,
        data: Any,
        origin: Provenance,
        pictures: Mapping[str, bytes],
        folder: Path | None = None,
    ) -> str:
        """Return the report as one HTML text.

        Parameters
        ----------
        result, data
        origin : Provenance
        pictures : mapping of str to bytes
            SVG by kind of figure.
        folder : Path, optional
            Where it will stand, for links to what lies there.
        """
        from sindyjoint.reporting.page import inline_svg, markup, render
        from sindyjoint.reporting.tables import findings_table

        kinds = self.figures(data)
        chosen, lead = self.lead(result, data), ""
        if chosen is not None and chosen[0] in pictures:
            from sindyjoint.reporting.style import SINGLE_COLUMN, figure_bytes

            kind = kinds[chosen[0]]
            figure = self.draw(kind, [kind.panels(data)[chosen[1]]], data, SINGLE_COLUMN)
            lead = markup(inline_svg(figure_bytes(figure, "svg"), "lead", kind.title))
        soundness = getattr(result, "soundness", None)
        return render(
            self.template,
            result=result,
            simulated=self.simulated(result),
            findings=findings_table(soundness.findings) if soundness is not None else None,
            data=data,
            trust=self.headline(result),
            question=self.question,
            lead_picture=lead,
            origin=origin,
            tables={table.name: table for table in self.tables(result)},
            kinds=kinds,
            pictures={
                name: markup(inline_svg(svg, name, kinds[name].title)) for name, svg in pictures.items()
            },
            **self.content(result, data, folder),
        )

    def origin(self, result: R, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return where a result came from."""
        from sindyjoint.reporting.provenance import provenance

        return provenance(None, seed, command_line, files)

    def files(self, result: R, data: Any) -> dict[str, str]:
        """Return the texts that are written in addition to page, record and figures, by name of file."""
        return {}

    def headline(self, result: R) -> Trust | None:
        """Return whether to trust a result and what to do next; None for what no such question is asked of."""
        return None

    def about(self, result: R) -> str:
        """Return the first line on a terminal: what this is a result of; with markup."""
        return ""

    def show(self, result: R) -> None:
        """Print the result for a person: whether to trust it, what it is, what to do next."""
        console, headline = terminal(), self.headline(result)
        console.print(self.about(result))
        if headline is not None:
            print_trust(headline, console)
            console.print(f"\n[bold]{self.question}[/]")
            print_lights(headline.question, console)
        self.show_result(result, console)
        if headline is not None:
            print_next_steps(headline, console)

    def show_result(self, result: R, console: Console) -> None:
        """Print what the result is."""
        raise NotImplementedError

    def details(self, result: R) -> Iterator[str]:
        """Yield the numbers behind it as lines: what ``--verbose`` adds."""
        return iter(())

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
        if self.renamed and isinstance(record, Mapping):
            record = {**record, **{name: record.get(saved) for name, saved in self.renamed.items()}}
        return unpack(self.data, record, self.unsaved)


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
