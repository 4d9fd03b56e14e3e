"""Every error that sindyjoint raises on purpose, and the refusal of names that nobody knows.

Each derives from :class:`SindyJointError` and from the builtin that fits, so both kinds of ``except`` work.
A message says what was given, what was expected and what to do. The command line turns any of them into one
line on stderr and an exit status: 2, the input is at fault, or 1, the answer is a reasoned "no".
"""

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class SindyJointError(Exception):
    """Base of every deliberate error of this package.

    Parameters
    ----------
    status : int
        The exit status of a command that ends with it.

    Examples
    --------
    >>> import sindyjoint
    >>> try:
    ...     sindyjoint.load_campaign("nowhere.toml")
    ... except sindyjoint.SindyJointError as error:
    ...     print(error)
    'nowhere.toml' does not exist; expected a campaign.toml, or a folder with one
    """

    status: ClassVar[int] = 2

    def __str__(self) -> str:
        # KeyError shows repr(message), OSError its fields; a sentence should read as a sentence.
        return str(self.args[0]) if self.args else ""


class InputError(SindyJointError, ValueError):
    """A value, a file's content or an option that cannot be used."""


class StandstillError(InputError):
    """A run in which the joint hardly moves."""


class MissingInputError(SindyJointError, FileNotFoundError):
    """A file or folder that was named does not exist."""


class UnitError(InputError):
    """An unknown unit, or one of the wrong dimension."""


class FormulaError(InputError):
    """A formula that cannot be parsed, or that reaches outside the allow-list."""


class UnknownNameError(SindyJointError, KeyError):
    """A term, library, method or option name that nobody knows."""


class OptionError(SindyJointError, TypeError):
    """An option that a function does not have."""


class UnsoundError(SindyJointError, ValueError):
    """Data so much at fault that nothing is made of them; carries the check that found it.

    The command line prints that check: the question was understood, and the answer is no.
    """

    status = 1

    def __init__(self, message: str, check: Any):
        super().__init__(message)
        self.check: Any = check


class NothingToDrawError(MissingInputError):
    """A result, such as a bare model, that is what it should be but holds no data for figures."""

    status = 1


class OutputError(SindyJointError, OSError):
    """A result that cannot be written where it was asked for."""


class MissingExtraError(SindyJointError, ImportError):
    """An optional dependency that this call needs is not installed."""


class WorkerError(SindyJointError, RuntimeError):
    """A task whose worker processes died, one after the other."""


class SimulationError(SindyJointError, ArithmeticError):
    """A simulation that left the range where its law holds; carries the time at which it did.

    The model could be read, and cannot be simulated so: no fault of the input.
    """

    status = 1

    def __init__(self, message: str, time: float | None = None):
        super().__init__(message)
        self.time = time


def refuse(faults: Iterable[tuple[object, str]]) -> None:
    """Raise InputError with the sentence of the first fault that is there.

    Examples
    --------
    >>> refuse([(False, "a is missing"), (0.0 < 1, "b is below 1")])
    Traceback (most recent call last):
    ...
    sindyjoint.errors.InputError: b is below 1
    """
    for there, sentence in faults:
        if there:
            raise InputError(sentence)


def checks_options(further: Callable[[], Iterable[str]] = tuple) -> Callable[[F], F]:
    """Make a function refuse options that it does not have, and name the nearest; `random_state` is `rng`.

    Parameters
    ----------
    further : callable
        Names of the options that it passes on.
    """

    def decorate(function: F) -> F:
        parameters = inspect.signature(function).parameters.values()
        named = [p.name for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]

        @functools.wraps(function)
        def checked(*args: Any, **options: Any) -> Any:
            where, unknown = f"{function.__name__}()", [name for name in options if name not in named]
            if unknown:
                known = dict.fromkeys([*named, *further()])
                refuse_unknown(where, unknown, {**known, "random_state": None} if "rng" in known else known)
            if "random_state" in unknown:
                # The name of before SPEC 7, and still that of scikit-learn.
                if "rng" in options:
                    raise OptionError(f"{where} got rng and random_state, which are one; give rng")
                options["rng"] = options.pop("random_state")
            return function(*args, **options)

        return checked  # type: ignore[return-value]

    return decorate


def refuse_unknown(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse the first name that is not among the known ones.

    Raises
    ------
    OptionError
    """
    known = list(known)
    for name in given:
        if name not in known:
            raise OptionError(f"{where} has no option {name!r}; {nearest(name, known, 'there are')}")


def nearest(name: str, known: Sequence[str], otherwise: str) -> str:
    """Return a question for the name that was probably meant, or else all known ones."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"{otherwise} {', '.join(known)}"
