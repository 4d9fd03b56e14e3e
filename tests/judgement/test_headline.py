"""Can I trust it, and what next: the lights and steps of made-up discoveries, with a case for each colour."""

import math

import pytest

from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.equation.model import Fitted, JointModel, ModelTerm
from sindyjoint.judgement.headline import Excitations, is_of_the_paper, make_headline
from sindyjoint.record import Joint

WHOLE = Excitations((3.0, 4.0, 5.0), ("low", "mid", "high"), 9)


def model(
    residual=0.01,
    floor=0.0099,
    terms=("linear_stiffness", "cubic_stiffness", "linear_damping"),
    name="bushing",
):
    library = load_catalogue("extended")
    made = tuple(
        ModelTerm(
            t.id,
            t.symbol,
            t.name,
            t.family,
            t.formula,
            (),
            t.unit_for("rotation"),
            1.0,
            0.01,
            (0.98, 1.02),
            0.3,
        )
        for t in (library[term] for term in terms)
    )
    fitted = Fitted(1.0, residual, floor, 0.9, 5000, 9, 1e-3, 0.1, (3.0, 4.0, 5.0))
    return JointModel(Joint(name), made, (), fitted)


def lights(**changes):
    given = {
        "model": model(),
        "tested": WHOLE,
        "held_out_rms": 0.0101,
        "soundness": "sound",
        "faults": (),
    } | changes
    made = make_headline(**given)
    return made, {light.name: light for light in made.lights}


def test_a_bushing_without_friction_is_trusted():
    # k1, k3, c1 explain 99.99 % of the mean square: that the paper's set is another is no reason for doubt.
    made, named = lights()
    assert made.answer == "Yes" and {light.colour for light in named.values()} == {"good"}
    assert named["fit"].sentence == "residual 1 % of the RMS moment, noise floor 0.99 %"
    assert made.next_steps[0][0].startswith("sindyjoint verify ")
    assert not is_of_the_paper("bushing") and is_of_the_paper("Inter-panel joint")


@pytest.mark.parametrize(
    ("changes", "name", "colour", "words", "step"),
    [
        ({"soundness": "doubtful", "faults": ["spikes"]}, "data", "fair", "doubtful: spikes", "sindyjoint check"),
        ({"soundness": "unsound", "faults": ["drift"]}, "data", "poor", "unsound: drift", "sindyjoint check"),
        ({"model": model(0.1, 0.01)}, "fit", "fair", "is neither", "sindyjoint diagnose"),
        ({"model": model(0.5, 0.01), "held_out_rms": 0.5}, "fit", "poor", "residual 50 %", "sindyjoint diagnose"),
        ({"model": model(0.01, math.nan)}, "fit", "fair", "its noise is unknown", "sindyjoint diagnose"),
        ({"held_out_rms": 0.015}, "held out", "fair", "1.50 times the residual", "sindyjoint compare"),
        ({"held_out_rms": 0.03}, "held out", "poor", "3.00 times the residual", "sindyjoint compare"),
        ({"held_out_rms": math.nan}, "held out", "fair", "nothing could be left out", "record further runs"),
        ({"tested": Excitations((3.0,), ("low",), 1)}, "coverage", "poor", "1 frequency, 1 level in 1 run",
         "record runs at 2 more frequencies and 2 more levels"),
        ({"tested": Excitations((3.0, 4.0), ("a", "b", "c"), 6)}, "coverage", "fair", "2 frequencies, 3 levels",
         "record runs at 1 more frequency"),
        ({"tested": Excitations((), (), 2)}, "coverage", "fair", "2 aperiodic runs", "record further runs"),
    ],
)  # fmt: skip
def test_each_doubt_has_its_colour_and_its_step(changes, name, colour, words, step):
    made, named = lights(**changes)
    assert named[name].colour == colour and words in named[name].sentence
    assert made.colour == max((light.colour for light in made.lights), key=["good", "fair", "poor"].index)
    assert any(do.startswith(step) for do, _ in made.next_steps)
    assert 1 <= len(made.next_steps) <= 2


def test_no_model_is_not_trusted():
    made, named = lights(model=model(terms=()))
    assert made.answer == "Not yet" and named["fit"].sentence == "no set of terms passed"
    assert made.to_dict()["answer"] == "poor" and made.to_dict()["next"][0]["do"].startswith(
        "sindyjoint compare"
    )
