"""Files written whole or not at all.

A reader never sees half a file: the bytes go to a temporary name in the same folder, then take the final name
in one step (``os.replace``). A folder of results is built aside and moved in when it is complete.

A process holds the folder that it builds by a lock, which ends with it, however it ends: a folder aside that nobody
holds is what a killed process left, and only that is cleared up. Where the system has no such locks it stays.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from sindyjoint.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

NEW, OLD = "new", "old"


def _make_write_error(path: Path, error: OSError) -> OutputError:
    """Say in one line why a path cannot be written."""
    return OutputError(f"cannot write {str(path)!r}: {error.strerror or error}; choose another path")


def _name_temporary(path: Path, kind: str = NEW) -> Path:
    """Return a hidden name next to ``path`` that nothing else uses."""
    return path.with_name(f"{_name_prefix(path)}{uuid.uuid4().hex[:12]}.{kind}.part")


def _name_prefix(path: Path) -> str:
    """Return how every name aside ``path`` begins, and no name aside another path."""
    return f".{hashlib.sha256(os.fsencode(path.name)).hexdigest()[:16]}."


def write_bytes(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file whole or not at all.

    Raises
    ------
    OutputError
        When the folder does not exist, the path is a folder, or the system refuses.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"cannot write {str(target)!r}: it is a folder; give the name of a file")
    temporary = _name_temporary(target)
    try:
        temporary.write_bytes(data)
        os.replace(temporary, target)
    except OSError as error:
        raise _make_write_error(target, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink()
    return target


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write a UTF-8 text file whole or not at all; see :func:`write_bytes`."""
    return write_bytes(path, text.encode("utf-8"))


def check_output(path: str | os.PathLike[str]) -> Path:
    """Check, before any long work, that a folder of results can be written; leave nothing behind.

    Raises
    ------
    OutputError
        When the path or one of its parents is a file, or the system refuses to write there.
    """
    folder = Path(path)
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        what = "it" if existing == folder else repr(str(existing))
        raise OutputError(
            f"cannot write into {str(folder)!r}: {what} is a file; expected the name of a folder"
        )
    # Permission bits say nothing to root and nothing about read-only file systems: only writing tells.
    probe = _name_temporary(existing / "probe")
    try:
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise _make_write_error(folder, error) from error
    return folder


def prepare_output(path: str | os.PathLike[str]) -> Path:
    """Check a folder of results as :func:`check_output` does, and make it where it is missing."""
    folder = check_output(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _make_write_error(folder, error) from error
    return folder


@contextmanager
def output_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a folder to fill; its files appear under ``path`` only when the block ends well.

    Files of the same names are replaced, other files stay. After an exception ``path`` is as it was before.

    Yields
    ------
    Path
        A temporary folder on the same file system.

    Raises
    ------
    OutputError
        When ``path`` cannot be a folder of results.
    """
    target = check_output(path)
    created = _missing_parents(target)
    done = False
    try:
        with _open_stage(target / "results", target) as stage:
            yield stage
            _move_in(stage, target)
        done = True
    finally:
        if not done:
            _remove_empty(created)


def _concerns_stage(error: OSError, stage: Path) -> bool:
    """Whether an error of the system is about writing into the stage, not about reading something else."""
    return error.filename is None or str(stage) in (str(error.filename) + str(error.filename2))


def _missing_parents(folder: Path) -> list[Path]:
    """Return the folders that making ``folder`` will create, innermost first."""
    missing = []
    while not folder.exists() and folder != folder.parent:
        missing.append(folder)
        folder = folder.parent
    return missing


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders that this call made, innermost first, as far as they are empty."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def _move_in(stage: Path, target: Path) -> None:
    """Move every file of the stage to the same path under the target."""
    files = sorted(path for path in stage.rglob("*") if path.is_file())
    for path in files:
        file = target / path.relative_to(stage)
        if file.is_dir():
            raise OutputError(f"cannot write {str(file)!r}: it is a folder; remove it or choose another path")
        file.parent.mkdir(parents=True, exist_ok=True)
    for path in files:
        os.replace(path, target / path.relative_to(stage))


@contextmanager
def whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a folder to fill that replaces ``path``, old contents and all, when the block ends well.

    It appears in one step: whoever looks sees the old folder, or the new one, or for an instant none, but never a
    part. After an exception the old folder is as it was before.

    Yields
    ------
    Path
        A temporary folder next to ``path``.

    Raises
    ------
    OutputError
        When ``path`` cannot be a folder of results.
    """
    target = check_output(path)
    with _open_stage(target, target) as stage:
        yield stage
        old = _name_temporary(target, OLD)
        with _hold_folder(target):
            if target.exists():
                os.replace(target, old)
            try:
                os.replace(stage, target)
            except BaseException:
                if old.exists():
                    os.replace(old, target)
                raise
            shutil.rmtree(old, ignore_errors=True)


def settle(path: str | os.PathLike[str]) -> None:
    """Clear up what killed processes left next to a folder; old contents that nothing has replaced go back."""
    target = Path(path)
    mark = _name_prefix(target)
    with suppress(OSError):
        for leftover in sorted(target.parent.iterdir()):
            if not (leftover.name.startswith(mark) and leftover.name.endswith(".part")):
                continue
            with _hold_folder(leftover) as held:
                if not held:
                    continue
                if leftover.name.endswith(f".{OLD}.part") and not target.exists():
                    os.replace(leftover, target)
                else:
                    shutil.rmtree(leftover, ignore_errors=True)


@contextmanager
def _open_stage(location: Path, target: Path) -> Iterator[Path]:
    """Give a folder aside ``location`` that this process holds; errors of the system there concern ``target``."""
    stage = _name_temporary(location)
    # It is held before it has the name by which others may find it.
    unnamed = location.with_name(f".{uuid.uuid4().hex}.part")
    try:
        location.parent.mkdir(parents=True, exist_ok=True)
        settle(location)
        unnamed.mkdir()
    except OSError as error:
        raise _make_write_error(target, error) from error
    try:
        with _hold_folder(unnamed):
            os.replace(unnamed, stage)
            yield stage
    except OSError as error:
        if isinstance(error, OutputError) or not _concerns_stage(error, stage):
            raise
        raise _make_write_error(target, error) from error
    finally:
        for folder in (unnamed, stage):
            shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _hold_folder(folder: Path) -> Iterator[bool]:
    """Hold a folder while the block lasts; False where another process does, or the system cannot tell."""
    handle = -1
    held = False
    try:
        with suppress(OSError):
            if fcntl is not None:
                handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                held = True
        yield held
    finally:
        if handle >= 0:
            os.close(handle)
