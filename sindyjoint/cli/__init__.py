"""The command line: options in, results on stdout, messages on stderr, exit status 0, 1 or 2.

What a console cannot show is spelled in ASCII, never a traceback.
"""

import atexit
import codecs
import gc
import os
import sys
import unicodedata
from collections import namedtuple
from contextlib import nullcontext, suppress
from typing import TextIO

from sindyjoint.hooks import fetched

__getattr__ = fetched(__name__, {"app": "make_app", "options": "given", "answer": "Progress"})

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


# Every matrix here is small: threads of the linear algebra would only wait for one another. Blocks of rows take them.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

INTERRUPTED = 130


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status.

    0: done. 1: ran, and the answer is a reasoned "no". 2: the input is at fault; one line on stderr says how.
    """
    try:
        _open_missing_streams()
        status = _run(sys.argv[1:] if arguments is None else arguments)
        # What is still held back, while a failure can be reported.
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    except KeyboardInterrupt as error:
        # Where the signal came while Python ran code of a string, as in making a record, it would end the process by
        # that signal although it was handled, until other such code has run: one more record is made.
        namedtuple("Ended", ())
        status = _complain("; ".join(["interrupted", *map(str, error.args)]), INTERRUPTED)
    except BrokenPipeError:
        # The reader of our output has gone (head, less): nothing to say, and no one to say it to.
        _discard(sys.stdout, sys.stderr)
        status = 0
    except MemoryError:
        status = _complain("not enough memory for this; give it less data at once, or a larger machine")
    except OSError as error:
        # What the system refuses at large: a full disk below stdout, a handle that was closed.
        _discard(sys.stdout)
        where = f" {error.filename!r}" if error.filename else ""
        status = _complain(f"the system refuses to read or write{where}: {error.strerror or error}")
    raise SystemExit(status)


def _run(arguments: list[str]) -> int:
    """Run the command line and return its exit status."""
    # A command makes more objects than it drops: to look at all of them for circles every time costs a tenth of it.
    gc.set_threshold(200_000)
    # Nor is there any use in circles as the process ends.
    atexit.register(gc.freeze)
    limited = any(name in os.environ for name in THREADS)
    for name in THREADS:
        os.environ.setdefault(name, "1")
    import typer

    from sindyjoint.cli.answer import Interrupted
    from sindyjoint.cli.app import command
    from sindyjoint.clock import all_cores
    from sindyjoint.errors import SindyJointError
    from sindyjoint.trust import PLACES, Places

    spell_output()
    for number, argument in enumerate(arguments):
        if not argument or (argument.startswith("--") and argument.endswith("=")):
            option = argument or (arguments[number - 1] if number else "argument 1")
            return _complain(
                f"nothing is given where something is expected ({option}); give a value, or leave it out"
            )
    # typer may bundle click: its public names lead to the classes that it raises.
    usage_error: type[Exception]
    click_error: type[Exception]
    _, usage_error, click_error = typer.BadParameter.__mro__[:3]
    here = PLACES.set(Places(("sindyjoint", *arguments)))
    try:
        with nullcontext() if limited else all_cores():
            status = command(arguments[0] if arguments else "")(
                args=arguments, prog_name="sindyjoint", standalone_mode=False
            )
    except typer.Exit as error:
        status = error.exit_code
    except Interrupted as error:
        raise KeyboardInterrupt(str(error)) from None
    except usage_error as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            # A bare command: its help, as it is.
            print(error.format_message())  # type: ignore[attr-defined]
            raise SystemExit(2) from None
        # Typer hands on what a validation library says.
        said = error.format_message().replace("Value error, ", "")  # type: ignore[attr-defined]
        typed = getattr(getattr(error, "ctx", None), "command_path", "sindyjoint")
        status = _complain(f"{said} (see '{typed} --help')")
    except click_error as error:
        status = _complain(error.format_message())  # type: ignore[attr-defined]
    except SindyJointError as error:
        status = _complain(str(error), error.status)
    except typer.Abort:
        raise KeyboardInterrupt from None
    finally:
        PLACES.reset(here)
    if status == INTERRUPTED:
        # What typer makes of Ctrl-C, without a word.
        raise KeyboardInterrupt
    return status if isinstance(status, int) else 0


def _open_missing_streams() -> None:
    """Give standard streams that were closed at the start a place: the next file would get their number."""
    if sys.stdout is None:
        # To read only: what is written there fails, as it should.
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")


def _discard(*streams: TextIO) -> None:
    """Lead streams that cannot be written to nowhere: at its end Python would try once more."""
    for stream in streams:
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


def _complain(message: str, status: int = 2) -> int:
    """Print one line on stderr, whatever the message holds; return the exit status that goes with it."""
    from sindyjoint.text import printable

    with suppress(OSError, ValueError):
        print("sindyjoint: " + printable(" ".join(message.split())), file=sys.stderr)
    return status
