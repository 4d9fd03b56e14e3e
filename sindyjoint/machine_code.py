"""Compiled functions without their compiler: the machine code that numba made, kept on disk and loaded by LLVM.

numba takes half a second to be imported and to fetch what it once compiled, LLVM alone a twentieth. The file's name
tells sources, versions and processor, so that it is never that of others; it may be deleted at any time.
"""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from contextlib import suppress
from functools import cache, cached_property
from hashlib import sha256
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
#: Modules whose ``ENTRIES`` are functions to call, and the files of the package that all code rests on.
MODULES = (
    "mechanics.kernels",
    "mechanics.stickslip_kernel",
    "equation.states_kernel",
    "discovery.best_subset_kernel",
)
SOURCES = ("machine_code.py", "equation/operations.py", *(f"{each.replace('.', '/')}.py" for each in MODULES))
#: LLVM ends the process where a function of C is missing: elsewhere than where this is tested numba loads.
LOADS = sys.platform == "linux"
#: What numba's code calls where an error is raised in it, or an array is freed that it has made. None of these
#: functions does either: without numba it ends the process.
NEVER_CALLED = (
    "NRT_Free", "NRT_MemInfo_call_dtor", "numba_do_raise", "numba_gil_ensure", "numba_gil_release",
    "numba_runtime_build_excinfo_struct", "numba_unpickle",
)  # fmt: skip
#: Engines own the code that they have loaded.
ENGINES: list[Any] = []


class Entry:
    """A compiled function of C that returns nothing; arrays go in as pointers, the caller sees to shape and kind.

    Parameters
    ----------
    name : str
        In the ``ENTRIES`` of its module.
    *arguments : type of ctypes, or ``None`` for an array
    """

    def __init__(self, name: str, *arguments: Any):
        self.name = name
        self.arguments = [ctypes.c_void_p if each is None else each for each in arguments]

    def __reduce__(self) -> tuple[Any, ...]:
        """Leave the address to this process."""
        return Entry, (self.name, *self.arguments)

    @cached_property
    def address(self) -> int:
        """Address of the function."""
        return _load(self.name) if LOADS else _compiled()[self.name].address

    @cached_property
    def _function(self) -> Any:
        return ctypes.CFUNCTYPE(None, *self.arguments)(self.address)

    def __call__(self, *values: Any) -> None:
        """Call the function; other threads go on meanwhile."""
        self._function(*(v.ctypes.data if isinstance(v, np.ndarray) else v for v in values))


@cache
def _compiled() -> dict[str, Any]:
    """Return what numba makes of all functions, by name; what it has cached itself it cannot give away."""
    from numba import cfunc

    entries = [each for name in MODULES for each in import_module(f"sindyjoint.{name}").ENTRIES.items()]
    return {
        name: cfunc(signature, cache=not LOADS, error_model="numpy", **options)(function)
        for name, (function, signature, options) in entries
    }


def _load(name: str) -> int:
    """Return the address of a function, its machine code loaded."""
    import llvmlite.binding as llvm

    symbol, code = _stored()[name]
    for each in NEVER_CALLED:
        # numba names its own once it compiles, now or later.
        if llvm.address_of_symbol(each) is None:
            llvm.add_symbol(each, ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value)
    engine = llvm.create_mcjit_compiler(
        llvm.parse_assembly(""), llvm.Target.from_default_triple().create_target_machine()
    )
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    ENGINES.append(engine)
    return int(engine.get_function_address(symbol))


@cache
def _stored() -> dict[str, tuple[str, bytes]]:
    """Return symbol and machine code of all functions by name, compiled where they are not on disk."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    told = [version("numba"), version("llvmlite"), sys.version, llvm.get_host_cpu_name(), features]
    texts = [(HERE / each).read_bytes() for each in SOURCES]
    key = sha256(b"".join([*texts, *map(str.encode, told)])).hexdigest()[:24]
    for folder in _folders():
        # A damaged file may raise anything.
        with suppress(Exception), np.load(folder / f"kernels-{key}.npz") as file:
            return {
                name: (str(file[name]), file[f"{name}.o"].tobytes()) for name in file.files if "." not in name
            }
    made = {
        name: (each._wrapper_name, each._library.serialize_using_object_code()[2][0])
        for name, each in _compiled().items()
    }
    for folder in _folders():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.glob("kernels-*.npz"):
                old.unlink()
            handle, temporary = tempfile.mkstemp(dir=folder, suffix=".npz")
            with os.fdopen(handle, "wb") as file:
                kept: dict[str, Any] = {name: np.array(symbol) for name, (symbol, _) in made.items()}
                kept |= {f"{name}.o": np.frombuffer(code, dtype=np.uint8) for name, (_, code) in made.items()}
                np.savez(file, **kept)
            os.replace(temporary, folder / f"kernels-{key}.npz")
            break
    return made


def _folders() -> list[Path]:
    """Return where code may be kept: where numba is told to; beside the compiled Python, or in the user's cache."""
    told = os.environ.get("NUMBA_CACHE_DIR")
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [Path(told)] if told else [HERE / "__pycache__", Path(home) / "sindyjoint"]
