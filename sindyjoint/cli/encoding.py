"""Output on consoles that cannot show every sign: what they cannot show is spelled in ASCII, never a traceback."""

from __future__ import annotations

import codecs
import sys
import unicodedata
from typing import TextIO

# Error handler and codec as Python knows them.
SPELLED = "sindyjoint.spelled"
ASCII = "sindyjoint_ascii"

SPELLINGS = {
    "·": "*", "⋅": "*", "×": "x", "±": "+/-", "−": "-", "–": "-", "—": "-", "…": "...", "’": "'", "≤": "<=",
    "≥": ">=", "≈": "~", "√": "sqrt", "∞": "inf", "°": "deg ", "→": "->", "←": "<-", "↔": "<->", "½": "1/2", "∂": "d",
    "∫": "integral ", "‖": "||", "µ": "u", "ᵀ": "^T", "ẋ": "x'", "ẍ": "x''",
    "\u0307": "'", "\u0308": "''", "\u0304": "_mean", "\u0303": "~", "\u2062": "*",
}  # fmt: skip
SUPERSCRIPTS = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+", strict=True))
SUBSCRIPTS = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
# With these a stream never refuses a sign; whoever set them wants them.
FORGIVING = ("replace", "ignore", "xmlcharrefreplace", "namereplace")


def spell_output() -> None:
    """Let stdout and stderr spell what their encoding cannot hold."""
    codecs.register_error(SPELLED, _spell_error)
    for stream in (sys.stdout, sys.stderr):
        _spell_stream(stream)


def _spell_stream(stream: TextIO | None) -> None:
    # A stream may be missing (pythonw) or a caller may give one, which holds any text.
    if stream is None or not hasattr(stream, "reconfigure"):
        return
    name = codecs.lookup(stream.encoding).name
    if stream.errors in FORGIVING or (name.startswith("utf") and stream.errors == "surrogateescape"):
        return
    if name == "ascii":
        # Click takes a stream of that name for a misconfigured one and writes UTF-8 past it, out of order.
        codecs.register(_ascii_codec)
        stream.reconfigure(encoding=ASCII, errors=SPELLED)
    else:
        stream.reconfigure(errors=SPELLED)


def _ascii_codec(name: str) -> codecs.CodecInfo | None:
    """Return ASCII under another name."""
    if name != ASCII:
        return None
    known = codecs.lookup("ascii")
    return codecs.CodecInfo(
        known.encode,
        known.decode,
        known.streamreader,
        known.streamwriter,
        known.incrementalencoder,
        known.incrementaldecoder,
        name=ASCII,
    )


def _spell_error(error: UnicodeError) -> tuple[str, int]:
    """Return the ASCII for the signs that an encoding does not have, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text, start, end = error.object, error.start, error.end
    return "".join(_spelling(text, position) for position in range(start, end)), end


def _spelling(text: str, position: int) -> str:
    """Return the character at a position in ASCII; one without a spelling, as a letter of a name, by its code."""
    sign = text[position]
    if sign in SUPERSCRIPTS:
        inside = position > 0 and text[position - 1] in SUPERSCRIPTS
        return SUPERSCRIPTS[sign] if inside else f"^{SUPERSCRIPTS[sign]}"
    if sign in SPELLINGS or sign in SUBSCRIPTS:
        return SPELLINGS.get(sign) or SUBSCRIPTS[sign]
    size, _, letter = unicodedata.name(sign, "").rpartition(" LETTER ")
    if size in ("GREEK SMALL", "GREEK CAPITAL") and letter.isalpha():
        word = letter.replace("LAMDA", "LAMBDA")
        return word.lower() if size == "GREEK SMALL" else word.capitalize()
    # A wrong letter would be a wrong name of a file: the code is at least no other name.
    return sign.encode("ascii", "backslashreplace").decode("ascii")
