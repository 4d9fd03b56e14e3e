"""The command line offers every method that discovery has, and no other."""

from sindyjoint.cli.options import Method
from sindyjoint.discovery.methods import METHODS


def test_methods_of_the_command_line_are_those_of_discovery():
    assert {method.value for method in Method} == set(METHODS)
