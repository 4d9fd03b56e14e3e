"""What stands above every result on a terminal: whether to trust it; and below it: what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sindyjoint.trust import Light, Trust

if TYPE_CHECKING:
    from rich.console import Console

NAMES = 8  # characters
TRUST, NEXT = "Can I trust it?", "What next?"
MARKS = {"good": ("green", "ok"), "fair": ("yellow", "mind"), "poor": ("red", "no")}


def print_trust(headline: Trust, console: Console) -> None:
    """Print whether to trust a result, and why."""
    colour, _ = MARKS[headline.colour]
    console.print(f"\n[bold]{TRUST}[/] [{colour}]{headline.answer}[/]")
    print_lights(headline.lights, console)


def print_lights(lights: Sequence[Light], console: Console) -> None:
    """Print reasons, one a line."""
    from rich.markup import escape

    wide = max([NAMES, *(len(light.name) for light in lights)])
    for light in lights:
        colour, mark = MARKS[light.colour]
        console.print(f"  [{colour}]{mark:<4}[/] {light.name:<{wide}}  {escape(light.sentence)}")


def print_next_steps(headline: Trust, console: Console) -> None:
    """Print what to do next: commands in one line each, to be copied."""
    from rich.markup import escape

    console.print(f"\n[bold]{NEXT}[/]")
    for do, to in headline.next_steps:
        console.print(f"  {escape(do)}  [dim]to {escape(to)}[/]", soft_wrap=True)
