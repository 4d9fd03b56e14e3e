"""The command line offers every method that discovery has, and pysindy's own optimizers."""

import re

import pytest

from sindyjoint import JointRegressor
from sindyjoint.errors import UnknownNameError
from tests.doors.asked import ask


def test_methods_of_the_command_line_are_those_of_discovery():
    offered = re.search(
        r"models is made: (.*?); or pysindy", " ".join(ask("discover", "--help").stdout.split())
    )[1]
    with pytest.raises(
        UnknownNameError, match=f"method is 'stlq'; expected one of {offered}, .* or such an object"
    ):
        JointRegressor(method="stlq").check_parameters()
    for name in offered.split(", "):
        JointRegressor(method=name).check_parameters()


def test_an_optimizer_of_pysindy_is_a_method():
    for name in ("STLSQ", "SR3", "SSR", "FROLS"):
        JointRegressor(method=f"pysindy:{name}").check_parameters()
    with pytest.raises(UnknownNameError, match="no optimizer 'STLQ'; did you mean 'STLSQ'?"):
        JointRegressor(method="pysindy:STLQ").check_parameters()
