"""Universal file format: data sets 58 (text) and 58b (binary) by pyuff."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.readers.table import Table, foreign, missing_extra

# Record 6 of data set 58: direction of the response.
DIRECTIONS = {0: "", 1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}


def read_uff(path: Path, data: bytes) -> Table:
    """Return the functions of a universal file, and ``time`` from their abscissa.

    A function is called by its first line of identification, or by node and direction such as ``12:+RZ``,
    with the label of its ordinate (``12:+RZ moment``) where one degree of freedom carries several: whatever
    is unique will do.

    Raises
    ------
    InputError
        For bytes that are no universal file, one without data set 58, or one that ends too early.
    MissingExtraError
        Without pyuff.
    """
    try:
        import pyuff
    except ImportError as error:
        raise missing_extra(path, "pyuff", error) from error
    with foreign(path, "a universal file"):
        file = pyuff.UFF(str(path))
        sets = [file.read_sets(int(n)) for n in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
    if not sets:
        raise InputError(f"{path}: holds no complete data set 58; it may be truncated or of another format")
    for number, function in enumerate(sets, start=1):
        if np.size(function["data"]) != int(function["num_pts"]):
            raise InputError(
                f"{path}: function {number} announces {int(function['num_pts'])} values and holds "
                f"{np.size(function['data'])}; the file may be truncated"
            )
    candidates = [_candidates(function) for function in sets]
    flat = [name for names in candidates for name in names]
    unique = [[name for name in names if flat.count(name) == 1] for names in candidates]
    names = [
        names_of[0] if names_of else f"function {number}" for number, names_of in enumerate(unique, start=1)
    ]
    aliases = {name: position for position, names_of in enumerate(unique) for name in names_of}

    def load(wanted: Sequence[int]) -> list[NDArray]:
        functions = [sets[position] for position in wanted if position < len(sets)]
        for other in functions[1:]:
            if not np.array_equal(other["x"], functions[0]["x"]):
                raise InputError(
                    f"{path}: its functions have different abscissas; expected the same instants"
                )
        time = (functions or sets)[0]["x"]
        return [sets[position]["data"] if position < len(sets) else time for position in wanted]

    return Table(path, (*names, "time"), load, aliases=aliases)


def _candidates(function: dict[str, Any]) -> list[str]:
    """Return the names of a function, the best name first."""
    identification = str(function.get("id1", "")).strip()
    direction = int(function["rsp_dir"])
    axis = DIRECTIONS.get(abs(direction), str(direction))
    point = f"{int(function['rsp_node'])}:{'-' if direction < 0 else '+'}{axis}"
    label = str(function.get("ordinate_axis_lab", "")).strip()
    named = [identification] if identification not in ("", "NONE") else []
    named += [point]
    return named + [f"{point} {label}"] if label not in ("", "NONE") else named
