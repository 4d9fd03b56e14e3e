"""What each stage of a diagnosis may cost, and what is said where that is used up."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.clock import Portion, Spent, spend
from sindyjoint.diagnosis import CAMPAIGN, Budget, Gap, Stages, explain_gap, load_effects
from sindyjoint.errors import SimulationError
from sindyjoint.mechanics import INTER_PANEL, harmonic, simulate
from sindyjoint.reporting import figures_of
from tests.diagnosis.handmade_problem import Based, Effect
from tests.diagnosis.hidden_effects import hide

UNLIMITED = {f.name: np.inf for f in fields(CAMPAIGN) if f.name.endswith("_work")}
# What the notes call each stage.
STAGES = {
    "search": "the search",
    "verdict": "the verdict",
    "numbers": "the refinement on the simulated response",
    "parts": "the division of the gap",
}


def pieces(done, count, work=10.0):
    for _ in range(count):
        spend(work)
        done.append(work)
    return done


def test_a_task_ends_with_the_piece_that_uses_its_portion_up():
    portion, done = Portion(35.0, np.inf), []
    assert portion.do(lambda: len(pieces(done, 2)), None, "two") == 2
    assert portion.do(lambda: pieces(done, 5), "what was there", "five") == "what was there"
    assert len(done) == 3 and portion.stopped == "after as much work as is allowed on any machine"
    assert portion.do(lambda: pieces(done, 1), "nothing", "one") == "nothing" and len(done) == 3
    assert portion.left_out == ["five", "one"] and portion.work == 40.0


def test_processor_time_ends_a_portion_between_two_pieces():
    portion, done = Portion(np.inf, 0.02), []
    assert (
        portion.do(lambda: [sum(range(20_000)) for _ in iter(lambda: pieces(done, 1), None)], None, "all")
        is None
    )
    assert done and portion.stopped.endswith("s of processor time") and portion.seconds < 2.0
    before = portion.seconds
    sum(range(500_000))
    assert portion.seconds == before  # nothing of what goes on outside of its tasks


def test_a_portion_within_another_ends_its_own_task_alone():
    outer, inner = Portion(100.0, np.inf), Portion(25.0, np.inf)
    done = []

    def task():
        inner.do(lambda: pieces(done, 9), None, "nine")
        return pieces(done, 2)

    assert len(outer.do(task, None, "all")) == 4 and inner.stopped and not outer.stopped
    with pytest.raises(Spent):
        Portion(1e9, np.inf).do(lambda: Portion(5.0, np.inf).count(10.0), None, "another one's")


def test_work_that_nobody_gave_a_portion_for_goes_on():
    assert len(pieces([], 3, 1e30)) == 3


def test_a_simulation_ends_after_the_steps_that_it_may_take():
    drive = harmonic(2.0, 4.0)
    steps = simulate(INTER_PANEL, drive, 1.0, 500).steps
    portion = Portion(np.inf, np.inf)
    assert (
        portion.do(lambda: simulate(INTER_PANEL, drive, 1.0, 500, most_steps=steps), None, "").steps == steps
    )
    assert portion.work >= steps
    with pytest.raises(SimulationError, match="too stiff"):
        simulate(INTER_PANEL, drive, 1.0, 500, most_steps=steps - 1)


@dataclass(frozen=True)
class Costly(Based):
    """A problem whose stages each cost ten samples and more."""

    noise: float = 0.24
    noise_floor = Gap(0.24, 0.24)

    def propose(self, refused, say):
        spend(10.0)
        return super().propose(refused, say)

    def zero_start(self, straight, last, say):
        spend(10.0)

    def uncertainty(self):
        spend(10.0)
        return Gap(0.0, 0.0)

    def finished(self):
        spend(10.0)
        return replace(self, gap=Gap(0.2, 0.2))

    def budget(self, first, last):
        spend(10.0)
        return Budget(0.5, 0.3, 0.1, 0.05, 0.05)

    def places(self):
        spend(10.0)
        return ("in the middle",)


def explained(**limits):
    """Return what is found of two effects, the second of which only helps beside the first."""
    effects = (Effect("first", 900.0, Gap(0.5, 0.5)), Effect("second", 500.0, Gap(0.25, 0.25)))

    def refined(last, whole):
        spend(10.0)
        return replace(last, gap=Gap(0.15, 0.15)), ("refined",)

    # Of so little work that the time in proportion is none.
    problem = Costly(candidates=effects, policy=replace(CAMPAIGN, slowest=1e-9, **limits))
    said = []
    return explain_gap(problem, 4, said.append, advised=False, refined=refined), said


def notes_of(result):
    """Return which stages left something out, by the notes."""
    return {
        stage
        for stage, name in STAGES.items()
        for note in result.warnings
        if note.startswith(f"{name} ended")
    }


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_that_may_do_nothing_says_so_and_names_nothing_more(stage):
    (whole, said), (result, _) = explained(), explained(**{f"{stage}_work": 0.0})
    assert [s.effect for s in whole.steps] == ["first", "second"] and whole.verdict == "named"
    assert not notes_of(whole) and {"the gap", "the numbers", "the parts of the gap"} <= set(said)
    assert whole.final.moment == 0.15 and "refined" in whole.warnings
    assert notes_of(result) == {stage}
    if stage == "search":
        assert result.steps == () and result.verdict == "undecided"
        assert "the search ended after as much work" in result.found["reason"]
    elif stage == "verdict":
        assert result.verdict == "undecided" and all(s.probability <= 0.5 for s in result.steps)
    else:
        assert result.verdict == "named" and [s.effect for s in result.steps] == ["first", "second"]
        assert [s.probability for s in result.steps] == [s.probability for s in whole.steps]
    if stage == "parts":
        assert np.isnan(result.found["budget"].total) and result.found["where"] == ()
    if stage == "numbers":
        assert result.final.moment == 0.25 == result.steps[-1].gap_after.moment
        assert "refined" not in result.warnings


def test_a_round_that_does_not_end_adds_nothing_and_those_before_it_stand():
    result, said = explained(search_work=15.0)
    assert [s.effect for s in result.steps] == ["first"] and result.verdict == "partly_named"
    assert "the search ended after as much work" in result.found["reason"] and notes_of(result) == {"search"}
    assert "stopping: what the search may cost is used up" in said
    note = next(note for note in result.warnings if note.startswith("the search ended"))
    assert "left out: further effects, " in note and note.endswith("the joint's own zero, other starts")


@pytest.fixture(scope="module")
def hidden():
    """A campaign with quadratic damping, and some candidates."""
    wanted = {"constant_moment", "quadratic_damping"}
    return hide("quadratic_damping", 0, duration=3.0).campaign, [e for e in load_effects() if e.id in wanted]


def diagnosed(hidden, **limits):
    campaign, effects = hidden
    return diagnose(campaign, effects=effects, advise=False, policy=replace(CAMPAIGN, **limits))


def test_a_diagnosis_of_a_campaign_within_its_portions_is_that_without_any(hidden):
    whole = diagnosed(hidden)
    assert whole.verdict == "named" and [s.effect for s in whole.steps] == ["quadratic_damping"]
    assert not notes_of(whole)
    assert diagnosed(hidden, **UNLIMITED).to_dict() == whole.to_dict()


def test_a_campaign_whose_stages_all_end_early_has_a_verdict_and_no_name(hidden):
    limits = dict.fromkeys((f"{stage}_work" for stage in STAGES), 1.0) | {"search_work": 1e5}
    result = diagnosed(hidden, **limits)
    assert notes_of(result) >= {"search", "parts"} and result.verdict == "undecided" and result.steps == ()
    assert set(result.to_dict()["budget"].values()) == {None}
    assert {"where", "budget"}.isdisjoint(figures_of(result)) and "gap" in figures_of(result)


def test_every_stage_has_work_and_seconds_of_its_own():
    policy = replace(
        CAMPAIGN, slowest=0.5, **{f"{stage}_work": place for place, stage in enumerate(STAGES, 1)}
    )
    stages = Stages.of(policy, lambda words: None)
    given = [(each.most_work, each.most_seconds) for each in map(stages.portions.get, STAGES)]
    assert given == [(place, 2 * place) for place in range(1, 5)]
