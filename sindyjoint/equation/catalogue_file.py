"""Files of catalogues and of models: found, read into entries or a model, and every fault of them said in one line.

No formula of a catalogue is looked at here and sympy is not needed for it; :mod:`sindyjoint.equation.catalogue` builds
terms from the entries.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from sindyjoint.documents import read_json, read_toml
from sindyjoint.equation.formula import VARIABLES, compile_terms, variable_symbols
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Term
from sindyjoint.equation.test_record import read_test
from sindyjoint.errors import InputError, MissingInputError, UnknownNameError, nearest, refuse
from sindyjoint.plain import Identifier, Line, entries_of


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
    ids = [entry.id for entry in catalogue.term]
    refuse(
        (ids.count(name) > 1, f"{path.name}: the id {name!r} is used twice; give each term another id")
        for name in ids
    )
    yield from ((entry, resolved) for entry in catalogue.term)


def _read_entries(path: Path) -> CatalogueEntry:
    data = read_toml(path, path.name)
    if isinstance(data.get("include"), list):
        # A catalogue as a whole may be given by its name alone.
        short = ({"catalogue": each} if isinstance(each, str) else each for each in data["include"])
        data["include"] = list(short)
    return entries_of(CatalogueEntry, data, path.name)


def as_model(model: JointModel | str | os.PathLike[str]) -> JointModel:
    """Return a model as it is given, or that of a file."""
    return model if isinstance(model, JointModel) else read_model(model)


def read_model(path: str | os.PathLike[str]) -> JointModel:
    """Read a model from ``model.json``, or from a folder of results that holds one.

    Raises
    ------
    MissingInputError
        If there is none.
    InputError
        If the file is no joint model; the message names file and field.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "model.json"
    if not file.is_file():
        within = [str(folder) for folder in _model_folders(Path(path))]
        raise MissingInputError(
            f"{str(path)!r}: no model is here; expected a model.json, or a folder with one, "
            + (f"such as {' or '.join(within)}" if within else "as 'discover --out' writes it")
        )
    data = read_json(file)
    try:
        model = JointModel.from_dict(data)
        _check_model(model)
    except (ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        raise InputError(f"{file}: {reason}") from error
    return model if model.test is not None else replace(model, test=read_test(file))


def read_models(path: str | os.PathLike[str]) -> list[JointModel]:
    """Read the model of a file or folder, or those of all kinds of joint in what ``discover RIG --out`` wrote.

    Raises
    ------
    MissingInputError, InputError
        As :func:`read_model`.
    """
    folder = Path(path)
    within = [] if (folder / "model.json").is_file() else _model_folders(folder)
    return [read_model(each) for each in within or [folder]]


def _model_folders(folder: Path) -> list[Path]:
    return sorted(file.parent for file in folder.glob("*/model.json")) if folder.is_dir() else []


def _check_model(model: JointModel) -> None:
    """Refuse a model of which a term is beyond all measure within the range that it was fitted on.

    Raises
    ------
    InputError
        Naming the term.
    """
    fitted, acceleration = model.fitted, variable_symbols()[2]
    terms = [term for term in model.terms if acceleration not in term.expression.free_symbols]
    if not (terms and fitted.moment_rms > 0 and fitted.angle > 0 and fitted.rate > 0):
        return
    angle, rate = (a.ravel() for a in np.meshgrid(fitted.angle * np.array([-1, -0.5, 0.5, 1]),
                                                  fitted.rate * np.array([-1, -0.5, 0.5, 1])))  # fmt: skip
    with np.errstate(all="ignore"):
        far = {each.name: max(each.tested or (each.reference,), key=abs) for each in model.inputs}
        columns = compile_terms([term.expression for term in terms], (*VARIABLES, *far))(
            angle, rate, np.nan, *far.values()
        )
    moments = np.abs(columns * [term.coefficient for term in terms]).max(axis=0)
    # A term of a law that was measured stays near the measured moment; collinear terms may cancel, not to this extent.
    refuse(
        (
            not moment <= 1e6 * fitted.moment_rms,
            f"term {term.id!r}: its coefficient {term.coefficient:g} makes {moment:.3g} within the tested range, "
            f"where {fitted.moment_rms:.3g} was measured; the file was changed or damaged",
        )
        for term, moment in zip(terms, moments, strict=True)
    )
