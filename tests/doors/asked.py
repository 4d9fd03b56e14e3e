"""The command line in this process, for fixtures that live longer than a test."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple

import jsonschema


class Answer(NamedTuple):
    """What a command left behind."""

    status: int
    stdout: str
    stderr: str


def ask(*arguments: object) -> Answer:
    """Run a command as a person would; a traceback comes through."""
    from sindyjoint.cli import main

    out, messages, status = io.StringIO(), io.StringIO(), 0
    with redirect_stdout(out), redirect_stderr(messages):
        try:
            main([str(each) for each in arguments])
        except SystemExit as leave:
            status = int(leave.code or 0)
    return Answer(status, out.getvalue(), messages.getvalue())


def checked_record(name: str, record: dict) -> dict:
    """Return a record as JSON has it, held against its printed schema."""
    text = json.dumps(record, allow_nan=False)
    jsonschema.validate(json.loads(text), json.loads(ask("schema", "--of", name).stdout))
    return json.loads(text)
