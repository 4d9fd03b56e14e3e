"""The command line offers every method that discovery has, and pysindy's own optimizers."""

import pytest

from sindyjoint.cli.options import METHODS as OFFERED
from sindyjoint.discovery.methods import METHODS, check_method, optimisers
from sindyjoint.errors import UnknownNameError


def test_methods_of_the_command_line_are_those_of_discovery():
    assert OFFERED == tuple(METHODS)


def test_every_optimizer_of_pysindy_that_needs_no_argument_is_a_method():
    assert {"STLSQ", "SR3", "SSR", "FROLS"} <= set(optimisers())
    for name in optimisers():
        check_method(f"pysindy:{name}")


def test_an_unknown_method_is_one_line():
    with pytest.raises(UnknownNameError, match="no optimizer 'STLQ'; did you mean STLSQ?"):
        check_method("pysindy:STLQ")
    with pytest.raises(
        UnknownNameError, match="method is 'stlq'; expected one of stlsq, .* or such an object"
    ):
        check_method("stlq")
