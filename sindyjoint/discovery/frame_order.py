"""Data frames whose columns do not stand in the order that an estimator reads them in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sindyjoint.errors import InputError

# What each position is, and the names by which a person may call it.
ORDER = ("angle", "rate", "acceleration")


def ordered_frame(X: Any, inputs: Sequence[str]) -> Any:
    """Return a data frame with its motion first and then the inputs, picked by name; an array as it is.

    Raises
    ------
    InputError
        For a frame that lacks an input, or whose columns of motion stand in another order.
    """
    names = [str(name) for name in getattr(X, "columns", ())]
    if not names or not inputs:
        refuse_order(X)
        return X
    lacking = [name for name in inputs if name not in names]
    if lacking:
        raise InputError(f"X has the columns {', '.join(names)}; expected one for the input {lacking[0]!r}")
    motion = X[[name for name in names if name not in inputs]]
    refuse_order(motion)
    return X[[*motion.columns, *inputs]]


def refuse_order(X: Any) -> None:
    """Refuse a data frame whose columns are named for another position than they stand in.

    Columns whose names say nothing are taken as they stand, as an array's are.

    Raises
    ------
    InputError
        Naming the columns, and the order that is expected.
    """
    names = getattr(X, "columns", None)
    if names is None:
        return
    from sindyjoint.files.drafting.survey import role_of

    kinds = {
        "angle": 0,
        "displacement": 0,
        "position": 0,
        "angular rate": 1,
        "velocity": 1,
        "acceleration": 2,
    }
    places = [kinds.get(role_of(str(name), "") or "") for name in names]
    wrong = [
        str(name)
        for at, (name, place) in enumerate(zip(names, places, strict=True))
        if place not in (None, at)
    ]
    if wrong:
        expected = [
            str(name)
            for place, name in sorted(zip(places, names, strict=True), key=lambda pair: pair[0] or 0)
        ]
        raise InputError(
            f"X has the columns {', '.join(map(str, names))}; expected {', '.join(ORDER[: len(places)])} in this "
            "order: "
            + (
                f"give X[{expected!r}]"
                if None not in places and len(set(places)) == len(places)
                else "reorder them"
            )
        )
