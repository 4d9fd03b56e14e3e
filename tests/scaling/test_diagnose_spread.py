"""A diagnosis on threads, on processes and on Dask: the same digits."""

import json
from functools import partial

import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis.campaign import rivals
from sindyjoint.diagnosis.campaign.designs import designs
from sindyjoint.errors import InputError
from sindyjoint.files import write_campaign
from sindyjoint.parallel import side_by_side, spread
from tests.conftest import effects_named
from tests.diagnosis.hidden_effects import hide
from tests.light_tasks import where

# Rivals, so that runs are advised; their internal states are searched roughly, then refined.
EFFECTS = ("dahl_friction", "bouc_wen_hysteresis")


@pytest.mark.slow
def test_where_the_candidates_are_tried_changes_no_digit(monkeypatch):
    pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    # Some of the runs that might be advised are enough here.
    monkeypatch.setattr(rivals, "designs", lambda *given: designs(*given)[::40])
    campaign = hide("dahl_friction", 0).campaign
    campaign = campaign.with_runs(campaign.runs[::6])
    effects = effects_named(*EFFECTS)
    results = [
        json.dumps(diagnose(campaign, effects=effects, max_effects=1, **way).to_dict())
        for way in ({}, {"jobs": 2}, {"workers": 2})
    ]
    record = json.loads(results[0])
    assert record["steps"] and record["advice"]
    assert results[1:] == results[:1] * 2
    # Without advice everything else is as it was, and nothing is said of a search for runs.
    stages: list[str] = []
    alone = diagnose(campaign, effects=effects, max_effects=1, advise=False, progress=stages.append).to_dict()
    search = {"status": "not_sought", "tried": 0, "planned": 0}
    assert alone == {**record, "advice": [], "advice_search": search} and "advice" not in stages


def test_tasks_deep_inside_run_where_they_are_spread_to():
    import os

    look = partial(where, {"a": 1, "b": 2})
    assert side_by_side(look, ["a", "b"]) == [(os.getpid(), 1), (os.getpid(), 2)]
    for way in ({"jobs": 2}, {"workers": 1}):
        if "workers" in way:
            pytest.importorskip("distributed", reason="dask[distributed] is not installed")
        with spread(**way):
            found = side_by_side(look, ["a", "b"])
        assert [value for _, value in found] == [1, 2]
        assert os.getpid() not in {process for process, _ in found}
    # And back again.
    assert side_by_side(look, ["a"])[0][0] == os.getpid()


def test_the_command_takes_the_options_and_refuses_two_of_them(tmp_path, sindyjoint):
    write_campaign(hide("nothing", 0).campaign, tmp_path)
    answer = sindyjoint("diagnose", tmp_path, "--jobs", "2", "--workers", "2")
    assert answer.status == 2 and "one way to run the tasks" in answer.stderr
    with pytest.raises(InputError, match="jobs is 0"):
        diagnose(hide("nothing", 0).campaign, jobs=0)
