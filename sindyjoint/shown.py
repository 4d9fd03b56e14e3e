"""What every result offers a person in Python: text, a table, pictures, a page."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.described import Described
from sindyjoint.hooks import supplied

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Shown(Described):
    """A result that shows itself.

    ``str`` gives what the command line prints, a notebook shows the equation and the main table, and ``figures`` lists
    what :meth:`plot` draws.
    """

    def __str__(self) -> str:
        return str(supplied("display").text_of(self))

    def __repr__(self) -> str:
        return str(supplied("display").line_of(self))

    def _repr_html_(self) -> str:
        return str(supplied("display").html_of(self))

    def _repr_latex_(self) -> str | None:
        found: str | None = supplied("display").latex_of(self)
        return found

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures that :meth:`plot` draws of this result."""
        return tuple(supplied("display").figures_of(self))

    def plot(self, kind: str | None = None, ax: Axes | None = None) -> Any:
        """Draw a figure of the result.

        Parameters
        ----------
        kind : str, optional
            One of ``figures``. Default: the first of them.
        ax : matplotlib Axes, optional
            Draw into these axes, for kinds that have one panel.

        Returns
        -------
        matplotlib Figure, or the axes that were given

        Raises
        ------
        UnknownNameError
            For an unknown kind, or one that the result cannot show.
        InputError
            For axes and a kind with several panels.
        """
        return supplied("display").plot(self, kind, ax)

    def to_frame(self) -> Any:
        """Return the main table as a pandas data frame, numbers in SI units.

        Raises
        ------
        MissingExtraError
            Without pandas.
        """
        return supplied("display").frame_of(self)

    def report(self, folder: str | os.PathLike[str], force: bool = False) -> Path:
        """Write page, record, tables and figures into a folder, as the command line does with ``--out``.

        Parameters
        ----------
        folder : path
        force : bool
            Replace files of the same names that were not written so, or were changed since.

        Returns
        -------
        Path
            The folder that they stand in: one within, where results of another kind came first.

        Raises
        ------
        OutputError
            If the folder cannot be written, or holds other files of these names.
        """
        path: Path = supplied("display").report(self, folder, force)
        return path
