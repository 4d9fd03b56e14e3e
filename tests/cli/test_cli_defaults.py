"""The command line and Python give the same result: every default of an option is that of the function it reaches."""

import importlib
import inspect

import pytest
import typer

from sindyjoint.cli import given, make_app
from sindyjoint.export import TARGETS

COMMANDS = typer.main.get_command(make_app()).commands
REGRESSOR, DISCOVER = "discovery.regression:SelectionRules", "workflows.discover:discover"
TEST, PLAN = "mechanics.virtual:virtual_test", "mechanics.virtual:VirtualTest"
SPREAD = ("jobs", "workers", "cluster")
OF_REGRESSOR = ("method", "selection", "threshold")
OF_DISCOVER = ("states", "bandwidth", "align", "random_state")


def of(function, *names):
    """Return option → function and parameter; the command line has for `rng` the older name."""
    return {name: (function, "rng" if name == "random_state" else name) for name in names}


# Command: option → function and parameter that it becomes.
CHANGED = "workflows.compare:changed"
REACHED = {
    "discover": of(DISCOVER, *OF_DISCOVER, "correct", "paper", *SPREAD) | of(REGRESSOR, *OF_REGRESSOR),
    "batch": of(DISCOVER, *OF_DISCOVER) | of(REGRESSOR, *OF_REGRESSOR) | of("workflows.batch:batch", *SPREAD),
    "compare": of(DISCOVER, "align")
    | of("workflows.compare:compare", "replicates", "margin", "random_state", *SPREAD),
    "diagnose": of("workflows.diagnose:diagnose", "model", "advise", "align", "random_state", *SPREAD),
    "verify": of(
        "workflows.verify:verify",
        "align",
        "tolerance",
        "draws",
        "window",
        "free_run",
        "noise",
        "presliding",
        "loss_factor",
        "random_state",
    ),
    "rig": of("workflows.simulate:rig_motion", "model"),
    "reproduce": of("workflows.reproduce:reproduce", "random_state"),
    "simulate": {
        **of(TEST, "joint", "noise", "frequencies", "levels"),
        **of(PLAN, "drive", "sample_rate", "duration", "settling"),
        "bits": (TEST, "quantisation"),
        "drift": (PLAN, "angle_drift"),
        "raw": (TEST, "raw_channels"),
        "format": ("files.writers:write_campaign", "format"),
    },
    "changed": of(CHANGED, "margin", "same_sensors"),
    "plan": of("workflows.plan:plan", "like", "model", "campaign", "drive", "goal", "until", "random_state"),
    "curves": of("workflows.curves:curves", "modes", "at", "point", "harmonics"),
    "plot": {
        "width": ("reporting.registry:draw", "width"),
        "dpi": ("reporting.style:figure_bytes", "dpi"),
    },
}
# Not given to a function where they are not given to the command: it then takes its default.
PASSED_ON = {
    "accept",
    "library",
    "base",
    "hold_out",
    "max_effects",
    "method",
    "require",
    "forbid",
    "rig",
    "nuisance",
    "at",
    # Of a plan: texts with units.
    "ranges",
    "limits",
    "noise",
    "terms",
    "band",
    "rate",
    "time",
    "plan",
    "resolution",
    "waveforms",
    "run_time",
    "effects",
    "diagnosis",
    "share",
    # Of curves, too.
    "frequencies",
    "amplitudes",
}
# What the command itself does.
OF_THE_COMMAND = {
    "out",
    "as_json",
    "force",
    "quiet",
    "verbose",
    "refine",
    "model",
    "reports",
    "verify_only",
    "diagnose",
    "campaign",
    "kind",
    "help",
    "plan",
    "of",
}
# Of the noise of the virtual test, which only a command makes.
OWN = {
    ("simulate", "random_state"): 0,
    ("curves", "levels"): None,
    ("simulate", "accelerometer"): None,
    ("simulate", "skew"): None,  # that of the model's rig
    ("changed", "random_state"): 0,
    ("init", "answers"): None,
    ("init", "yes"): False,
}


def options():
    for name, command in COMMANDS.items():
        if name in ("libraries", "schema", "export"):
            continue
        for parameter in command.params:
            if not parameter.required:
                yield pytest.param(name, parameter.name, parameter.default, id=f"{name}-{parameter.name}")


def signature_default(function, name):
    module, _, wanted = function.partition(":")
    found = getattr(importlib.import_module(f"sindyjoint.{module}"), wanted)
    return inspect.signature(found).parameters[name].default


def plain(value):
    """Return a default as the function has it: enumerations by their value, lists of numbers as numbers."""
    value = getattr(value, "value", value)
    if isinstance(value, str) and "," in value:
        return tuple(float(part) for part in value.split(","))
    return value


@pytest.mark.parametrize(("command", "option", "default"), [*options()])
def test_every_default_is_that_of_the_function(command, option, default):
    if option in REACHED.get(command, {}):
        assert plain(default) == signature_default(*REACHED[command][option])
    elif (command, option) in OWN:
        assert default == OWN[command, option]
    elif option in PASSED_ON:
        assert default is None
    else:
        assert option in OF_THE_COMMAND, f"{command} --{option}: say here which function's default it is"
        assert default in (None, False)


@pytest.mark.parametrize(
    ("command", "option", "function", "stated"),
    [
        ("discover", "library", (DISCOVER, "library"), "[{}]"),
        ("diagnose", "max_effects", ("workflows.diagnose:diagnose", "max_effects"), "[{}; of a rig"),
        ("diagnose", "max_effects", ("workflows.diagnose:diagnose_structure", "max_effects"), "of a rig {}]"),
        ("plan", "time", ("workflows.plan:plan", "time"), "[{:g} s]"),
        ("plan", "share", ("workflows.plan:plan", "share"), "[{:g}]"),
    ],
)
def test_what_a_help_says_of_a_default_is_so(command, option, function, stated):
    (help,) = (p.help for p in COMMANDS[command].params if p.name == option)
    assert stated.format(signature_default(*function)) in help


def test_every_target_of_an_export_is_named():
    (help,) = (p.help for p in COMMANDS["export"].params if p.name == "to")
    assert help == f"{', '.join([*TARGETS][:-1])} or {[*TARGETS][-1]}."


def test_only_what_is_given_is_passed_on():
    assert given(library=None, base=[], jobs=0, align=False) == {"jobs": 0, "align": False}
