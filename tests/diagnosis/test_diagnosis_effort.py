"""What the search for separating runs may cost, and that the diagnosis is there before it begins."""

import json
from dataclasses import replace

import pytest

from sindyjoint import diagnose
from sindyjoint.clock import Portion
from sindyjoint.diagnosis import CAMPAIGN, engine, load_effects
from sindyjoint.diagnosis.campaign import rivals
from sindyjoint.diagnosis.campaign.designs import designs
from sindyjoint.files import write_campaign
from sindyjoint.parallel import side_by_side, spread
from tests.diagnosis.hidden_effects import hide
from tests.light_tasks import spending, square_sum


@pytest.mark.parametrize("jobs", [1, 2])
def test_processor_time_and_work_hold_what_other_processes_did(jobs):
    portion = Portion(1000.0, 1e9)

    def spend_on_three(work):
        return portion.do(lambda: side_by_side(spending, [work] * 3), None, f"three of {work:.0f}")

    with spread(jobs):
        with Portion() as clock:
            found = side_by_side(square_sum, [2_000_000] * 3)
        done = [spend_on_three(work) for work in (100.0, 150.0, 90.0, 10.0)]
    assert found == [square_sum(2_000_000)] * 3
    # The parent waits, unless the tasks stay with it.
    assert clock.seconds > clock.elsewhere and (clock.elsewhere > 0.0) == (jobs == 2)
    # 300 and 450 are 750; with 270 more it is used up, whoever does them, and nothing is begun after that.
    assert done == [[100.0] * 3, [150.0] * 3, None, None]
    assert portion.stopped and portion.left_out == ["three of 90", "three of 10"]


@pytest.fixture(scope="module", autouse=True)
def fewer():
    """Try a part of the runs that could be made: how many are counted is not how well they separate."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rivals, "designs", lambda *given: designs(*given)[::3])
        yield


@pytest.fixture(scope="module")
def ambiguous():
    """A campaign and the only two candidates: a constant moment, and the zero error that nothing tells from it."""
    wanted = {"constant_moment", "angle_offset"}
    return hide("constant_moment", 0, duration=2.0).campaign, [e for e in load_effects() if e.id in wanted]


@pytest.fixture(scope="module")
def sought(ambiguous):
    """Its diagnosis with advice, what was handed over before that, and what was said on the way."""
    campaign, effects = ambiguous
    kept, said = [], []
    result = diagnose(campaign, effects=effects, before_advice=kept.append, progress=said.append)
    return result, kept, said


def test_the_diagnosis_is_handed_over_whole_before_advice_begins(sought):
    result, (before,), said = sought
    assert before.search.status == "not_sought" and before.advice == ()
    assert result.search.status == "complete" and result.search.tried == result.search.planned > 20
    first, last = before.to_dict(), result.to_dict()
    assert {k for k in last if first[k] != last[k]} == {"advice", "advice_search"}
    counts = [stage for stage in said if stage.startswith("advice: ") and " runs tried" in stage]
    assert len(counts) > 1


def test_a_search_that_is_stopped_says_so_and_nothing_depends_on_who_tries_the_runs(ambiguous, sought):
    campaign, effects = ambiguous
    whole = sought[0]
    policy = replace(CAMPAIGN, advice_work=5e3, slowest=1.0)
    short = diagnose(campaign, effects=effects, policy=policy)
    assert short.search.status == "stopped" and short.search.tried < short.search.planned
    assert "ended after as much work as is allowed on any machine" in short.warnings[0]
    assert [s.effect for s in short.steps] == [s.effect for s in whole.steps]
    # The same on every machine: the count of runs that were tried, and with other processes, started once for both.
    with spread(2):
        assert diagnose(campaign, effects=effects, policy=policy).search == short.search
        assert diagnose(campaign, effects=effects).advice == whole.advice
    assert (
        diagnose(campaign, effects=effects, policy=replace(CAMPAIGN, slowest=float("inf"))).search.tried == 0
    )


def test_an_interruption_of_advice_leaves_the_diagnosis(
    ambiguous, tmp_path, monkeypatch, sindyjoint, few_effects
):
    campaign, effects = ambiguous
    few_effects(*(effect.id for effect in effects))

    def interrupted(*given):
        raise KeyboardInterrupt

    write_campaign(campaign, tmp_path / "tests")
    monkeypatch.setattr(engine, "advise", interrupted)
    command = ("diagnose", tmp_path / "tests", "--out", tmp_path / "out", "--max-effects", "1", "--verbose")
    answer = sindyjoint(*command)
    assert answer.status == 130
    stages = [line.split(" s  ")[1] for line in answer.stderr.splitlines()[:4]]
    assert stages == ["loading", "checking the data", "force states", "the gap"]
    record = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert record["advice_search"]["status"] == "not_sought" and record["steps"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Runs that would tell rivals apart have not been sought." in page
    assert (tmp_path / "out" / "model.json").exists()
