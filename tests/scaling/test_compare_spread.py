"""A comparison of methods and its bootstrap, in this process and on others: the same digits."""

import json

import pytest

from sindyjoint import compare, simulate


def digits(result):
    """Return all that was found, less the times that it took."""

    def timeless(value):
        if isinstance(value, dict):
            return {key: timeless(v) for key, v in value.items() if "seconds" not in key}
        return [timeless(v) for v in value] if isinstance(value, list) else value

    return json.dumps(timeless(result.to_dict()))


@pytest.mark.slow
def test_where_methods_and_replicates_are_worked_on_changes_no_digit():
    pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    campaign = simulate(random_state=0, duration=2.0)
    campaign = campaign.with_runs(campaign.runs[::3])
    wanted = {"methods": ["stlsq", "ensemble"], "libraries": ["paper"], "replicates": 100, "correct": False}
    one, two, dask = (compare(campaign, **wanted, **way) for way in ({}, {"jobs": 2}, {"workers": 2}))
    assert [choice.name for choice in one.methods] == ["stlsq", "ensemble"]
    assert max(one.inclusion) == 1.0 and 0 < sum(one.inclusion) < len(one.ids)
    assert digits(two) == digits(one) and digits(dask) == digits(one)
