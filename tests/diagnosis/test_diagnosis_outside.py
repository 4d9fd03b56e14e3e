"""What no catalogue holds is answered with unknown; what a catalogue holds is not."""

import numpy as np
import pytest
from sindyjoint.diagnosis.campaign.unnamed.outside import outside_probability, prior, series_probability

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.catalogue import load_effects, select_effects
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.motion import MeasuredMotion
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.workflows.diagnose import diagnose
from tests.diagnosis.hidden_effects import hide

PHASES = 200
# Rows of unit noise: forms below this size, in units of noise, are not to be seen.
LARGE = 3.0


def runs_of(frequencies=(3.0, 4.0, 5.0, 6.0), levels=(1.0, 0.5)):
    phase = 2 * np.pi * (np.arange(PHASES) + 0.5) / PHASES
    made = []
    for frequency in frequencies:
        for level in levels:
            w = 2 * np.pi * frequency
            angle, rate = level * np.sin(phase), level * w * np.cos(phase)
            motion = MeasuredMotion(
                angle, rate, -(w**2) * angle, 1 / (frequency * PHASES), np.zeros(PHASES), frequency,
                np.zeros(PHASES), np.zeros(PHASES), np.arange(PHASES), True,
            )  # fmt: skip
            name = f"{frequency:g}-{level:g}"
            ones = np.ones(PHASES)
            made.append(GapRun(name, name, str(level), motion, np.zeros(PHASES), np.eye(PHASES), ones, True))
    return made


def fitted(*names):
    return [
        FittedEffect(e, e.variants[0], np.empty(0), np.ones(1), 0.0)
        for e in select_effects(load_effects(), names)
    ]


def problems(rest, explained=20.0, seed=0):
    """Return the problems before and after a hardening was found, with a rest per run beside it."""
    runs = runs_of()
    rng = np.random.default_rng(seed)
    base = np.vstack([np.column_stack([r.angle, r.rate, np.sign(r.rate)]) for r in runs])
    cubic = np.concatenate([r.angle**3 for r in runs])
    target = base @ [100.0, 1.0, 10.0] + explained * cubic
    target = target + np.concatenate([rest(r) for r in runs]) + rng.standard_normal(target.size)
    first = GapRegression.of_columns(runs, base, target)
    return first, GapRegression.of_columns(runs, np.column_stack([base, cubic]), target)


@pytest.mark.parametrize("seed", range(5))
def test_an_effect_that_is_there_leaves_nothing_for_the_unknown(seed):
    first, last = problems(lambda r: 0.0 * r.angle, seed=seed)
    assert outside_probability(first, last, fitted("quintic_stiffness")) < 0.06


@pytest.mark.parametrize(
    "rest",
    [
        lambda r: LARGE * (r.motion.frequency / 6) ** 4 * r.angle,
        lambda r: LARGE * (r.name == "4-1") * r.rate / np.abs(r.rate).max(),
        lambda r: LARGE * np.sin(9 * r.angle),
        lambda r: LARGE * np.sin(40 * np.arange(PHASES)),
    ],
    ids=["of the frequency", "of one run", "of the angle", "of no form"],
)
def test_a_rest_of_any_form_is_evidence(rest):
    first, last = problems(rest)
    assert outside_probability(first, last, fitted("quintic_stiffness")) > 0.95


def test_a_rest_in_proportion_to_a_large_gain_is_none():
    """Columns along a measured motion err: three thousandths of what they explain says nothing."""
    rest = 0.003 * 3000.0

    def error(run):
        return rest * np.sin(9 * run.angle)

    first, last = problems(error, explained=3000.0)
    assert outside_probability(first, last, fitted("quintic_stiffness")) < 0.1
    # The same rest beside little is another matter.
    first, last = problems(error, explained=20.0)
    assert outside_probability(first, last, fitted("quintic_stiffness")) > 0.95


def test_many_effects_are_less_likely_than_one_that_nobody_knows():
    one = fitted("inertia_error")
    assert (
        prior(one)
        < prior([*one, *fitted("dead_zone")])
        < prior([*one, *fitted("dead_zone", "cubic_damping")])
    )
    # A channel's error comes with any joint; two dependences on frequency are one.
    assert prior([*one, *fitted("channel_delay", "angle_offset")]) == prior(one)
    assert prior([*one, *fitted("frequency_dependent_stiffness")]) > 0


def test_terms_that_discovery_found_count_among_the_laws():
    one = fitted("quintic_stiffness")
    assert prior(one, terms=1) == prior([*one, *fitted("dead_zone")])
    assert series_probability(one, 0) < 0.02 < series_probability(one, 2) < series_probability(one, 5)
    assert series_probability(one, 9) <= CAMPAIGN.outside


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, seed, most",
    [
        ("second_resonance", 1, None),
        ("second_resonance", 2, 2),
        ("relay", 2, 2),
        ("clipping", 3, None),
    ],
)
def test_what_is_in_no_catalogue_is_unknown(name, seed, most):
    """Also where the search must end early; names that help a little stand beside a stated remainder."""
    result = diagnose(hide(name, seed).campaign, advise=False, **({"max_effects": most} if most else {}))
    remains = result.final.moment > 1.5 * result.noise_floor.moment
    assert result.verdict == "unknown" or (result.verdict == "partly_named" and remains)
    assert all(step.probability <= 0.5 for step in result.steps)
    assert all("unknown" in dict(step.rivals) for step in result.steps)


@pytest.mark.slow
def test_what_only_the_terms_of_discovery_know_is_named_from_there():
    """No effect of the catalogue is θ·θ̇², but a candidate term is: the other start finds it."""
    result = diagnose(hide("rate_squared_stiffness", 621).campaign, advise=False)
    assert (result.verdict, [s.effect for s in result.steps]) == ("named", ["rate_squared_stiffness"])
    assert result.final.moment < 1.1 * result.noise_floor.moment < 0.3 * result.initial.moment
    assert "from the model as it was given it ends with" in result.warnings[0]


@pytest.mark.slow
@pytest.mark.parametrize("name, seed", [("jenkins_element", 502), ("backlash_play", 502)])
def test_a_slider_that_some_runs_never_reach_is_still_named(name, seed):
    """At the lowest level it never slips, and stays about its middle.

    The play is named for a part: what of the moment it explains, the response simulated with it does not follow.
    """
    result = diagnose(hide(name, seed).campaign, advise=False)
    assert result.verdict in ("named", "ambiguous", "partly_named") and name in result.steps[0].members
    assert (result.verdict == "partly_named") == (result.final.response > 1.5 * result.noise_floor.response)
