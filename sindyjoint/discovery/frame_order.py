"""Data frames whose columns do not stand in the order that an estimator reads them in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sindyjoint.errors import InputError

# The position of what the name of a column speaks of: angle, rate, acceleration.
PLACES = {"angle": 0, "displacement": 0, "position": 0, "angular rate": 1, "velocity": 1, "acceleration": 2}


def ordered_frame(X: Any, inputs: Sequence[str]) -> Any:
    """Return a data frame with angle, rate and acceleration first and then the inputs, by name; an array as it is.

    Columns whose names say nothing are taken as they stand, as an array's are.

    Raises
    ------
    InputError
        For a frame that lacks an input, or of whose columns only some have names for another position.
    """
    from sindyjoint.files.drafting.survey import role_of

    columns = list(getattr(X, "columns", ()))
    names = [str(column) for column in columns]
    if not names:
        return X
    lacking = [name for name in inputs if name not in names]
    if lacking:
        raise InputError(f"X has the columns {', '.join(names)}; expected one for the input {lacking[0]!r}")
    motion = [column for column in columns if str(column) not in inputs]
    places = [PLACES.get(role_of(str(column), "") or "") for column in motion]
    known = [place for place in places if place is not None]
    if len(known) == len(motion) and sorted(known) == list(range(len(motion))):
        motion = [column for _, column in sorted(zip(known, motion, strict=True), key=lambda pair: pair[0])]
    elif any(place not in (None, at) for at, place in enumerate(places)):
        raise InputError(
            f"X has the columns {', '.join(names)}; expected angle, rate{', acceleration' * (len(motion) > 2)}: "
            "reorder them, or give an array"
        )
    return X[[*motion, *inputs]]
