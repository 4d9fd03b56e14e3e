"""Equations of effects as MathML: moments that are no terms, their states, decays; and captions of sliding joints."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from sindyjoint.diagnosis import FittedEffect, load_effects
from sindyjoint.reporting import effect_mathml, kinds_of
from sindyjoint.reporting.mathml import mathml
from sindyjoint.text import in_words_of
from tests.reporting.handmade_results import diagnosis

EFFECTS = {effect.id: effect for effect in load_effects()}


def fitted(name):
    effect = EFFECTS[name]
    (variant, *_) = effect.variants
    size, nonlinear = len(variant.columns), len(variant.parameters)
    return FittedEffect(effect, variant, np.ones(nonlinear), np.ones(size), 1.0)


def text_of(markup):
    return "".join(ElementTree.fromstring(f"<x>{markup}</x>").itertext()).replace(" ", "")


@pytest.mark.parametrize("name", sorted(EFFECTS))
@pytest.mark.parametrize("motion", ["rotation", "translation"])
def test_every_effect_is_well_formed_and_has_a_line_for_each_state(name, motion):
    effect = fitted(name)
    lines = effect_mathml(effect, motion)
    assert lines.count("<math ") == 1 + len(effect.variant.states)
    assert text_of(lines)[0] == ("M" if motion == "rotation" else "F")
    assert ("θ" in text_of(lines)) <= (motion == "rotation" or "theta" in str(effect.variant))


def test_a_slider_has_its_rate_and_its_limit():
    text = text_of(effect_mathml(fitted("jenkins_element"), "translation"))
    assert text.startswith("FJenkinselement=kt") and "z˙=x˙," in text and "|z|≤θy" in text


def test_a_decay_is_a_factor_with_a_negative_exponent():
    lines = effect_mathml(fitted("stribeck_friction"), "rotation")
    assert "<msup><mi>e</mi><mrow><mo>−</mo><mfrac>" in lines


def test_the_equation_names_moments_that_are_no_terms():
    model = diagnosis().model
    text = text_of(mathml(model, ["play <b>"]))
    assert text.endswith("+Mplay<b>") and "<b>" not in mathml(model, ["play <b>"])
    assert mathml(model) == mathml(model, [])


def test_captions_speak_of_what_the_joint_does():
    result = diagnosis()
    joint = replace(result.model.joint, motion="translation", inertia=None)
    sliding = replace(result, model=replace(result.model, joint=joint))
    assert "cells of angle and rate" in kinds_of(result)["maps"].caption
    assert "cells of displacement and velocity" in kinds_of(sliding)["maps"].caption
    assert in_words_of("rotation", "Moment over angle") == "Moment over angle"
    assert in_words_of("translation", "Moment of a triangle, separate") == "Force of a triangle, separate"
