"""The command line in this process, for fixtures that live longer than a test."""

from __future__ import annotations

import io
import json
import re
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple

import jsonschema


class Answer(NamedTuple):
    """What a command left behind."""

    status: int
    stdout: str
    stderr: str


def without_stages(messages: str, arguments: tuple[object, ...]) -> str:
    """Return messages without the stages that slow commands name, which depend on the clock, unless asked for."""
    asked = {"--verbose", "-v"} & {*map(str, arguments)}
    return messages if asked else re.sub(r"(?m)^ *\d+\.\d\d s  .*\n", "", messages)


def ask(*arguments: object) -> Answer:
    """Run a command as a person would; a traceback comes through."""
    from sindyjoint.cli import main

    out, messages, status = io.StringIO(), io.StringIO(), 0
    with redirect_stdout(out), redirect_stderr(messages):
        try:
            main([str(each) for each in arguments])
        except SystemExit as leave:
            status = int(leave.code or 0)
    return Answer(status, out.getvalue(), without_stages(messages.getvalue(), arguments))


def checked_record(name: str, record: dict) -> dict:
    """Return a record as JSON has it, held against its printed schema."""
    text = json.dumps(record, allow_nan=False)
    jsonschema.validate(json.loads(text), json.loads(ask("schema", "--of", name).stdout))
    return json.loads(text)
