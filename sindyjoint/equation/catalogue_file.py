"""Reading catalogue files: TOML to validated entries, includes followed, every fault in one line.

No formula is looked at here and sympy is not needed; :mod:`sindyjoint.equation.catalogue` builds terms from
the entries.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from sindyjoint.documents import read_toml
from sindyjoint.equation.terms import Term
from sindyjoint.errors import InputError, MissingInputError, UnknownNameError, nearest
from sindyjoint.plain import Identifier, Line
from sindyjoint.tables import entries_of


@dataclass(frozen=True)
class IncludeEntry:
    """Another catalogue, whole or some of its terms."""

    catalogue: Line
    terms: tuple[Identifier, ...] | None = None


@dataclass(frozen=True)
class CatalogueEntry:
    """A catalogue file."""

    name: Line
    description: Line
    include: tuple[IncludeEntry, ...] = ()
    term: tuple[Term, ...] = ()


# A term and the file that it stands in.
Located = tuple[Term, Path]


def library_folder() -> Path:
    """Return the folder of the shipped catalogues.

    It is inside the package in a wheel, and next to the package in an editable install.

    Raises
    ------
    MissingInputError
        If it is in neither folder.
    """
    package = Path(__file__).resolve().parents[1]
    folders = (package / "libraries", package.parent / "libraries")
    for folder in folders:
        if (folder / "paper.toml").is_file():
            return folder
    raise MissingInputError(
        f"the shipped catalogues are neither in {folders[0]} nor in {folders[1]}; install sindyjoint again"
    )


def shipped_names() -> tuple[str, ...]:
    """Return the names of the shipped catalogues, in alphabetical order."""
    return tuple(sorted(path.stem for path in library_folder().glob("*.toml")))


def find_catalogue(name_or_path: str | Path, folder: Path | None = None) -> Path:
    """Return the file of a catalogue given by shipped name or by path.

    Parameters
    ----------
    name_or_path : str or Path
        A text without a slash and without ``.toml`` is a shipped name.
    folder : Path, optional
        Folder that relative paths start from; the working folder if omitted.

    Raises
    ------
    UnknownNameError, MissingInputError, InputError
    """
    text = str(name_or_path)
    if isinstance(name_or_path, str) and not text.endswith(".toml") and not set(text) & {"/", "\\"}:
        names = shipped_names()
        if text not in names:
            close = get_close_matches(text, names, n=1)
            hint = f"did you mean {close[0]!r}? Expected" if close else "expected"
            raise UnknownNameError(
                f"library {text!r} is unknown; {hint} one of {', '.join(names)}, or the path of "
                "another, which ends in .toml"
            )
        return library_folder() / f"{text}.toml"
    path = Path(text) if folder is None else folder / text
    if path.is_dir():
        raise InputError(f"catalogue {text}: is a folder; expected a .toml file")
    if not path.is_file():
        hint = f"; the shipped library is called {path.stem!r}" if path.stem in shipped_names() else ""
        raise MissingInputError(f"catalogue {text}: no such file{hint}")
    return path


def gather_catalogue(path: Path) -> tuple[str, str, tuple[Located, ...]]:
    """Return name, description and terms of a catalogue file, those that it includes among them.

    Raises
    ------
    InputError
        For anything wrong with a file's content, circular includes among it.
    UnknownNameError
        For an include or a picked term that does not exist.
    """
    catalogue = _read_entries(path)
    terms: dict[str, Located] = {}
    for entry, home in _collect_terms(path, catalogue, ()):
        earlier = terms.setdefault(entry.id, (entry, home))
        if earlier != (entry, home):
            raise InputError(
                f"{path.name}: term {entry.id!r} is defined in {earlier[1].name} and in {home.name}; include one of "
                "them, or rename yours"
            )
    check_symbols(path.name, [(entry.id, entry.symbol) for entry, _ in terms.values()])
    if not terms:
        raise InputError(f"{path.name}: holds no term; add a [[term]] or include a catalogue")
    return catalogue.name, catalogue.description, tuple(terms.values())


def check_symbols(where: str, ids_and_symbols: list[tuple[str, str]]) -> None:
    """Raise InputError if two terms bear one symbol."""
    owners: dict[str, str] = {}
    for term_id, symbol in ids_and_symbols:
        if symbol in owners:
            raise InputError(
                f"{where}: terms {owners[symbol]!r} and {term_id!r} both have the symbol {symbol!r}; "
                "a symbol belongs to one term"
            )
        owners[symbol] = term_id


def _collect_terms(path: Path, catalogue: CatalogueEntry, parents: tuple[Path, ...]) -> Iterator[Located]:
    resolved = path.resolve()
    if resolved in parents:
        names = " → ".join(link.name for link in (*parents[parents.index(resolved) :], resolved))
        raise InputError(f"catalogue {path.name} includes itself: {names}; take one include out")
    for include in catalogue.include:
        try:
            other = find_catalogue(include.catalogue, folder=path.parent)
        except (UnknownNameError, MissingInputError) as error:
            raise type(error)(f"{path.name}: include: {error}") from None
        located = list(_collect_terms(other, _read_entries(other), (*parents, resolved)))
        if include.terms is None:
            yield from located
            continue
        by_id = {term.id: (term, home) for term, home in located}
        for term_id in include.terms:
            if term_id not in by_id:
                raise UnknownNameError(
                    f"{path.name}: include: {include.catalogue!r} has no term {term_id!r}; "
                    + nearest(term_id, list(by_id), "it has")
                )
            yield by_id[term_id]
    ids = set()
    for entry in catalogue.term:
        if entry.id in ids:
            raise InputError(f"{path.name}: the id {entry.id!r} is used twice; give each term another id")
        ids.add(entry.id)
        yield entry, resolved


def _read_entries(path: Path) -> CatalogueEntry:
    data = read_toml(path, path.name)
    if isinstance(data.get("include"), list):
        # A catalogue as a whole may be given by its name alone.
        short = ({"catalogue": each} if isinstance(each, str) else each for each in data["include"])
        data["include"] = list(short)
    return entries_of(CatalogueEntry, data, path.name)
