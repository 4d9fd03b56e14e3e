"""Inputs that nobody would write, made from ones that somebody would, by a seed and a number."""

from __future__ import annotations

import copy
import io
import json
import random
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NUMBERS = (
    "0", "-1", "1e999", "nan", "inf", "-0.0", "1e-320", "1e30", "9" * 400, "9" * 5000, "0x10", "1_000", "true",
    "null", "99999999999", "[]", "{}", '""',
)  # fmt: skip
TEXTS = (
    "\x1b[31m", "\\u001b", "\u202e", "\\ud800", "=1+1", "'", '"', "[" * 300, "{" * 300, "a." * 60, "\n", "\r", "\0",
    ",", ";", "\t", "#", "%", "exp(", "**", "theta", "(", ")", "..", "/", "\\", "NaN", "Infinity",
    "N*m", "dB", "degC", "é",
)  # fmt: skip
INTEGERS = tuple(
    value.to_bytes(size, order)
    for size in (4, 8)
    for order in ("little", "big")
    for value in (0, 1, 2**31 - 1, 2 ** (8 * size) - 1, 2**28, 2 ** (8 * size - 1))
)
VALUES = (
    None, True, 0, -1, 1e300, 1e-320, float("nan"), float("inf"), 2**70, "", "x", "\x1b[31m", [], {}, [[]], [None],
    {"": None}, [1.0] * 50, "theta", "1e5",
)  # fmt: skip
_NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:e[+-]?\d+)?")
_WORD = re.compile(r'"[^"\n]*"|\w+|[^\w\s]')


def mutate_text(text: str, rng: random.Random) -> str:
    """Return a text with a few of its numbers, words and lines replaced, repeated or taken out."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        kind = rng.randrange(7)
        found = list((_NUMBER if kind == 0 else _WORD).finditer(text)) if kind < 4 else []
        if found:
            start, end = rng.choice(found).span()
            other = rng.choice(found).group()
            text = text[:start] + (rng.choice(NUMBERS), rng.choice(TEXTS), "", other)[kind] + text[end:]
        elif kind == 4:
            at = rng.randrange(len(text) + 1)
            text = text[:at] + rng.choice(TEXTS + NUMBERS) + text[at:]
        elif kind == 5:
            lines = text.split("\n")
            at = rng.randrange(len(lines))
            lines[at : at + 1] = rng.choice(([], [lines[at]] * 2, [lines[at], rng.choice(lines)]))
            text = "\n".join(lines)
        else:
            text = text[: rng.randrange(len(text) + 1)]
    return text


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return bytes of which a few are changed, overwritten with lengths that tempt, repeated, taken out or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        if not out:
            break
        # Heads and tails, where formats keep their lengths, as often as everything between.
        edge = min(len(out), 512)
        at = rng.choice((rng.randrange(len(out)), rng.randrange(edge), len(out) - rng.randint(1, edge)))
        kind = rng.randrange(7)
        if kind == 0:
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[at] = rng.randrange(256)
        elif kind in (2, 3):
            integer = rng.choice(INTEGERS)
            out[at : at + len(integer)] = integer
        elif kind == 4:
            del out[at : at + rng.choice((1, 4, 8, 100))]
        elif kind == 5:
            out[at:at] = out[at : at + rng.choice((1, 8, 64))]
        elif rng.random() < 0.3:
            del out[at:]
    return bytes(out)


def mutate_tree(text: str, rng: random.Random) -> str:
    """Return a JSON document of which a few values are others, taken out, or stand in the wrong place."""
    content = [json.loads(text)]
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        above: Any = content
        at: Any = 0
        while isinstance(above[at], dict | list) and above[at] and rng.random() < 0.85:
            above = above[at]
            at = rng.choice(list(above)) if isinstance(above, dict) else rng.randrange(len(above))
        kind = rng.randrange(5)
        if kind == 0:
            del above[at]
            content = content or [None]
        elif kind == 1 and isinstance(above[at], list):
            above[at] = rng.choice((above[at][:-1], above[at] * 2, above[at][::-1]))
        else:
            above[at] = copy.deepcopy(rng.choice(VALUES))
    return json.dumps(content[0])


def mutate_archive(data: bytes, rng: random.Random) -> bytes:
    """Return a ZIP archive of which one member is mutated; its checksums are right."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        members = old.namelist()
        victim = rng.choice(members)
        for name in members:
            content = old.read(name)
            if name == victim and content[:1] == b"<":
                content = mutate_text(content.decode(), rng).encode("utf-8", "surrogatepass")
            elif name == victim:
                content = mutate_bytes(content, rng)
            new.writestr(name, content)
    return out.getvalue()


@dataclass(frozen=True)
class Target:
    """One kind of input: examples to begin with, and what reads a file (or text) of it."""

    examples: list[str] | list[bytes]
    read: Callable[[Path], None] | Callable[[str], None]
    name: str | None = None
    """Of the file; None where the text itself is read."""

    def make(self, kind: str, seed: int, number: int) -> str | bytes:
        rng = random.Random(f"{kind}/{seed}/{number}")
        example = rng.choice(self.examples)
        deep = rng.random() < 0.6
        if isinstance(example, bytes):
            return (mutate_archive if deep and example[:2] == b"PK" else mutate_bytes)(example, rng)
        return (mutate_tree if deep and example[:1] in "{[" else mutate_text)(example, rng)

    def run(self, given: str | bytes, folder: Path) -> None:
        """Read an input; whatever is wrong with it is raised."""
        if self.name is None:
            assert isinstance(given, str)
            self.read(given)
            return
        path = folder / self.name
        path.write_bytes(given.encode("utf-8", "surrogatepass") if isinstance(given, str) else given)
        self.read(path)
