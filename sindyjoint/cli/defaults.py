"""Defaults of options, read from the functions that the commands call."""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1]


def default_of(function: str, name: str) -> Any:
    """Return the default of a parameter, from the source: to import the function takes seconds, and ``--help`` none.

    Parameters
    ----------
    function : str
        Module inside the package and function, or class, such as ``"workflows.discover:discover"``.
    name : str
        Of a parameter, or of a field of a dataclass.

    Raises
    ------
    LookupError
        If there is no such function, or no such parameter with a default that is a constant.
    """
    module, _, owner = function.partition(":")
    for node in _tree(module).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == owner:
            found = _defaults(node).get(name)
            if found is not None:
                return _value(found, module)
    raise LookupError(f"{function} has no parameter {name!r} with a default")


def constant_of(constant: str) -> Any:
    """Return a constant from the source of its module, such as ``"export:TARGETS"``.

    Raises
    ------
    LookupError
        If there is none.
    """
    module, _, name = constant.partition(":")
    return _value(ast.Name(name), module)


def given(**options: Any) -> dict[str, Any]:
    """Return the options that were given: the others keep the defaults of the function that is called."""
    return {name: value for name, value in options.items() if value is not None and value != []}


@cache
def _tree(module: str) -> ast.Module:
    path = PACKAGE.joinpath(*module.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(path.read_text(encoding="utf-8"))


def _defaults(node: ast.FunctionDef | ast.ClassDef) -> dict[str, ast.expr]:
    """Return the default of every parameter; of a class those of its ``__init__``, or its fields."""
    if isinstance(node, ast.ClassDef):
        inits = [f for f in node.body if isinstance(f, ast.FunctionDef) and f.name == "__init__"]
        if inits:
            return _defaults(inits[0])
        fields = [f for f in node.body if isinstance(f, ast.AnnAssign) and f.value is not None]
        return {ast.unparse(field.target): field.value for field in fields if field.value is not None}
    given = node.args
    found = dict(zip([a.arg for a in given.args[::-1]], given.defaults[::-1], strict=False))
    return found | {
        a.arg: value
        for a, value in zip(given.kwonlyargs, given.kw_defaults, strict=True)
        if value is not None
    }


def _value(node: ast.expr, module: str) -> Any:
    """Return a constant, what the name of one stands for, or a limit of a policy, whose module is light."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return getattr(_policy(node.value.id, module), node.attr)
    if not isinstance(node, ast.Name):
        return ast.literal_eval(node)
    for line in _tree(module).body:
        if isinstance(line, ast.Assign):
            for target in line.targets:
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                for i, each in enumerate(names):
                    if isinstance(each, ast.Name) and each.id == node.id:
                        value = _value(line.value, module)
                        return value[i] if isinstance(target, ast.Tuple) else value
        if isinstance(line, ast.ImportFrom) and line.module and node.id in [a.name for a in line.names]:
            return _value(node, line.module.removeprefix("sindyjoint."))
    raise LookupError(f"{module} has no constant {node.id}")


def _policy(name: str, module: str) -> Any:
    """Return the policy that a module imports under a name; such a module imports nothing heavy itself."""
    for line in _tree(module).body:
        if isinstance(line, ast.ImportFrom) and line.module:
            for alias in line.names:
                if name == (alias.asname or alias.name):
                    return getattr(import_module(line.module), alias.name)
    raise LookupError(f"{module} imports no {name}")
