"""The command line: options in, results on stdout, messages on stderr, exit status 0, 1 or 2."""

from __future__ import annotations

import os
import sys
from contextlib import nullcontext

# Every matrix here is small: threads of the linear algebra would only wait for one another. Blocks of rows take them.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit status.

    0: done. 1: ran, and the answer is a reasoned "no". 2: the input is at fault; one line on stderr says how.
    """
    limited = any(name in os.environ for name in THREADS)
    for name in THREADS:
        os.environ.setdefault(name, "1")
    import typer

    from sindyjoint.cli.app import app
    from sindyjoint.cli.encoding import spell_output
    from sindyjoint.errors import SindyJointError
    from sindyjoint.threads import all_cores

    spell_output()
    # typer may bundle click: its public names lead to the classes that it raises.
    usage_error: type[Exception]
    click_error: type[Exception]
    _, usage_error, click_error = typer.BadParameter.__mro__[:3]
    try:
        with nullcontext() if limited else all_cores():
            status = app(args=arguments, prog_name="sindyjoint", standalone_mode=False)
    except typer.Exit as error:
        status = error.exit_code
    except usage_error as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            # A bare command: its help, as it is.
            print(error.format_message())  # type: ignore[attr-defined]
            raise SystemExit(2) from None
        _complain(f"{error.format_message()} (see 'sindyjoint{_command(error)} --help')")  # type: ignore[attr-defined]
        status = 2
    except click_error as error:
        _complain(error.format_message())  # type: ignore[attr-defined]
        status = 2
    except SindyJointError as error:
        _complain(str(error))
        status = 2
    except (KeyboardInterrupt, typer.Abort):
        _complain("interrupted")
        status = 130
    except BrokenPipeError:
        # The reader of our output has gone (head, less): nothing to say, and no one to say it to.
        sys.stderr.close()
        status = 0
    raise SystemExit(status if isinstance(status, int) else 0)


def _complain(message: str) -> None:
    """Print one line on stderr, whatever the message holds."""
    print("sindyjoint: " + " ".join(message.split()), file=sys.stderr)


def _command(error: object) -> str:
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else ""
    return path.removeprefix("sindyjoint")
