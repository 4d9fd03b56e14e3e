"""Files written whole or not at all.

A reader never sees half a file: the bytes go to a temporary name in the same folder, then take the final name
in one step (``os.replace``). A folder of results is built aside and moved in when it is complete.

A process holds the folder that it builds by a lock, which ends with it, however it ends: a folder aside that nobody
holds is what a killed process left, and only that is cleared up. Where the system has no such locks it stays.
"""

import hashlib
import os
import shutil
import signal
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from sindyjoint.documents import SUMS, find_foreign, read_list, sums_of, sums_text
from sindyjoint.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

NEW, OLD = "new", "old"


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Say in one line why a path cannot be written."""
    try:
        yield
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"cannot write {str(path)!r:.200}: {reason}; choose another path") from error


def name_temporary(path: Path, kind: str = NEW) -> Path:
    """Return a hidden name next to ``path`` that nothing else uses."""
    return path.with_name(f"{_name_prefix(path)}{uuid.uuid4().hex[:12]}.{kind}.part")


def _name_prefix(path: Path) -> str:
    """Return how every name aside ``path`` begins, and no name aside another path."""
    return f".{hashlib.sha256(os.fsencode(path.name)).hexdigest()[:16]}."


def write_bytes(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file whole or not at all; what a killed process left of writing it is cleared up.

    Raises
    ------
    OutputError
        When the folder does not exist, the path is a folder or a device, or the system refuses.
    """
    target = Path(path)
    if target.exists() and not target.is_file():
        kind = "folder" if target.is_dir() else "device or a pipe"
        raise OutputError(f"cannot write {str(target)!r}: it is a {kind}; give the name of a file")
    with _writing(target):
        settle(target)
        with _hold_new(target, Path.touch) as temporary:
            temporary.write_bytes(data)
            os.replace(temporary, target)
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
    existing = next(filter(os.path.exists, (folder, *folder.parents)), folder)
    with _writing(folder):
        # Of a name that is too long, or of a loop of links, the system says so at once.
        for path in (*(existing / part for part in folder.parts[len(existing.parts) :]), folder):
            with suppress(FileNotFoundError, NotADirectoryError):
                os.lstat(path)
    if not existing.is_dir():
        what = "it" if existing == folder else repr(str(existing))
        raise OutputError(
            f"cannot write into {str(folder)!r}: {what} is a file; expected the name of a folder"
        )
    # Permission bits say nothing to root and nothing about read-only file systems: only writing shows.
    probe = existing / "probe"
    with _writing(folder):
        settle(probe)
        with _hold_new(probe, Path.touch):
            pass
    return folder


def prepare_output(path: str | os.PathLike[str]) -> Path:
    """Check a folder of results as :func:`check_output` does, and make it where it is missing."""
    folder = check_output(path)
    with _writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def output_folder(
    path: str | os.PathLike[str], kind: str = "", whole: bool = True, force: bool = False
) -> Iterator[Path]:
    """Give a folder to fill; its files appear under ``path`` only when the block ends well.

    A folder that is not there yet appears in one step. In one that is, results of the same kind are replaced and other
    files stay; a process that is killed meanwhile leaves a list of hashes that says so, and readers refuse the folder
    until the next run has written it. After an exception in the block ``path`` is as it was before.

    Parameters
    ----------
    path : path
    kind : str
        Of the results; the next results of this kind replace them. Empty: files of the same names are replaced.
    whole : bool
        Whether files of this kind go that are not written again.
    force : bool
        Whether files are replaced that are no such results, or were changed since.

    Yields
    ------
    Path
        A temporary folder on the same file system.

    Raises
    ------
    OutputError
        When ``path`` cannot be a folder of results, or holds other files of these names.
    """
    target = check_output(path)
    created = [folder for folder in (target, *target.parents) if not folder.exists()]
    try:
        with _open_stage(target / "results" if target.exists() else target, target) as stage:
            yield stage
            sums = sums_of(stage)
            write_bytes(stage / SUMS, sums_text(sums, kinds=dict.fromkeys(sums, kind)).encode())
            _move_in(stage, target, sums, kind, whole, force)
    # Also after Ctrl-C: what this call made goes, innermost first, as far as it is empty.
    except BaseException:
        for folder in created:
            with suppress(OSError):
                folder.rmdir()
        raise


def _move_in(stage: Path, target: Path, sums: dict[str, str], kind: str, whole: bool, force: bool) -> None:
    """Move every file of the stage to the same path under the target, the list of hashes last."""
    if not target.exists():
        with suppress(OSError):
            os.rename(stage, target)
            return
    for name in sums:
        file = target / name
        if file.is_dir():
            raise OutputError(f"cannot write {str(file)!r}: it is a folder; remove it or choose another path")
    with hold_folder(target, wait=True), _uninterrupted():
        if not force:
            refuse_foreign(target, sums, kind)
        # Whatever became of the list: what it says of files that are there.
        listed = read_list(target, damaged=True)
        known = {name: digest for name, digest in listed.sums.items() if (target / name).is_file()}
        kinds = {**listed.kinds, **dict.fromkeys(sums, kind)}
        stale = [name for name in known if whole and kind and kinds[name] == kind and name not in sums]
        changed = find_foreign(target, stale, kind)
        write_text(target / SUMS, sums_text({**known, **sums}, finished=False, kinds=kinds))
        for name in sums:
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(stage / name, target / name)
        for name in stale:
            if name not in changed:
                (target / name).unlink()
            del known[name]
        write_text(target / SUMS, sums_text({**known, **sums}, kinds=kinds))


def refuse_foreign(folder: Path, names: Iterable[str], kind: str = "") -> None:
    """Raise OutputError where one of some files is there and is no result of this kind as it was written."""
    foreign = find_foreign(folder, names, kind)
    if foreign:
        more = f" (and {len(foreign) - 1} more)" if len(foreign) > 1 else ""
        raise OutputError(
            f"cannot write {str(folder / foreign[0])!r}{more}: it was not written by this command, or was changed "
            "since; choose another folder, or replace it with --force (force=True)"
        )


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
        old = name_temporary(target, OLD)
        with hold_folder(target), _uninterrupted():
            if target.exists():
                os.replace(target, old)
            try:
                os.replace(stage, target)
            # Whatever stops it, the old results stand again.
            except BaseException:
                if old.exists():
                    os.replace(old, target)
                raise
            shutil.rmtree(old, ignore_errors=True)


def settle(path: str | os.PathLike[str]) -> None:
    """Clear up what killed processes left next to a path; old contents that nothing has replaced go back."""
    target = Path(path)
    mark = _name_prefix(target)
    with suppress(OSError):
        for leftover in sorted(target.parent.glob(f"{mark}*.part")):
            with hold_folder(leftover) as held:
                if not held:
                    continue
                if leftover.name.endswith(f".{OLD}.part") and not target.exists():
                    os.replace(leftover, target)
                elif leftover.is_dir():
                    shutil.rmtree(leftover, ignore_errors=True)
                else:
                    leftover.unlink()


@contextmanager
def _open_stage(location: Path, target: Path) -> Iterator[Path]:
    """Give a folder in one aside ``location`` that this process holds; errors of the system concern ``target``."""
    stage = location
    try:
        location.parent.mkdir(parents=True, exist_ok=True)
        settle(location)
        with _hold_new(location, Path.mkdir) as held:
            # What is held stays where it is: the folder within it may be moved, and held by itself.
            stage = held / "results"
            stage.mkdir()
            yield stage
    except OSError as error:
        # About writing into the stage, not about reading something else.
        concerned = error.filename is None or str(stage) in (str(error.filename) + str(error.filename2))
        if not (stage == location or concerned):
            raise
        with _writing(target):
            raise


@contextmanager
def _hold_new(location: Path, make: Callable[[Path], None]) -> Iterator[Path]:
    """Make a file or folder aside ``location``, hold it while the block lasts, then remove what is left of it.

    Between its making and its holding another process may take it for a leftover: then it is made again.
    """
    temporary, handles = name_temporary(location), ExitStack()
    try:
        with _uninterrupted():
            make(temporary)
            while handles.enter_context(hold_folder(temporary)) is False or not temporary.exists():
                temporary = name_temporary(location)
                make(temporary)
        yield temporary
    finally:
        with _uninterrupted(), handles:
            if temporary.is_dir():
                shutil.rmtree(temporary, ignore_errors=True)
            with suppress(OSError):
                temporary.unlink()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait until the block has ended: of what belongs together nothing is written without the rest."""
    came: list[int] = []
    try:
        before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    except ValueError:  # of a thread that Ctrl-C does not come to
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def hold_folder(folder: Path, wait: bool = False) -> Iterator[bool | None]:
    """Hold a folder while the block lasts; False where another process or thread does, None where that is unknown.

    The lock ends with its process, however that ends. With ``wait`` the block begins when the other one has ended.
    """
    handle, held = -1, None
    if fcntl is not None:
        try:
            handle = os.open(folder, os.O_RDONLY)
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            held = True
        except BlockingIOError:
            held = False
        except OSError:
            held = None  # none to be had, or no such locks here
    try:
        yield held
    finally:
        if handle >= 0:
            os.close(handle)
