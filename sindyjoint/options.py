"""Options of Python calls that are misspelt, answered with the nearest one there is."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from sindyjoint.errors import OptionError

F = TypeVar("F", bound=Callable[..., Any])


def checks_options(further: Callable[[], Iterable[str]] = tuple) -> Callable[[F], F]:
    """Make a function refuse options that it does not have, and name the nearest.

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
            unknown = [name for name in options if name not in named]
            if unknown:
                refuse_unknown(f"{function.__name__}()", unknown, [*named, *further()])
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
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise OptionError(f"{where} has no option {name!r}; {hint}")
