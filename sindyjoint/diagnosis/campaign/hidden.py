"""A virtual test of the inter-panel joint in which the seed hides an effect."""

from __future__ import annotations

from typing import Any

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import load_effects, select_effects
from sindyjoint.diagnosis.effects.fitted import FittedEffect, effect_law
from sindyjoint.equation.terms import Reference
from sindyjoint.mechanics.laws import INTER_PANEL
from sindyjoint.mechanics.stickslip import transfer_moment
from sindyjoint.mechanics.virtual import LEVELS, virtual_campaign
from sindyjoint.record import Campaign

CHOICES = (
    "amplitude_dependent_damping",
    "dead_zone",
    "position_dependent_friction",
    "dahl_friction",
    "maxwell_branch",
    "quadratic_damping",
    "jenkins_element",
    "nothing",
)
SHARE = 0.06
FREQUENCIES = (3.0, 4.0, 5.0, 6.0)


def hidden_campaign(random_state: Any = None) -> tuple[Campaign, str]:
    """Return a virtual test and the name of the effect, of 6 % of the moment's RMS, that the seed hid in it."""
    generator = np.random.default_rng(0 if random_state is None else random_state)
    name = str(generator.choice(CHOICES))
    law = None if name == "nothing" else _hidden_law(name, generator)
    campaign = virtual_campaign(INTER_PANEL, hidden=law, noise=0.01, random_state=generator, duration=8.0)
    return campaign, name


def _hidden_law(name: str, generator: np.random.Generator) -> Any:
    """Return the law of an effect with nonlinear parameters drawn within their bounds, scaled to its share."""
    peak = LEVELS[0] * INTER_PANEL.softening_angle
    reference = Reference(peak, 2 * np.pi * FREQUENCIES[-1] * peak)
    effect = select_effects(load_effects(), [name])[0]
    variant = effect.variants[0]
    bounds = np.log(variant.bounds(reference)).reshape(-1, 2)
    inner = np.exp(
        bounds[:, 0] + generator.uniform(0.4, 0.7, bounds.shape[0]) * np.diff(bounds, axis=1)[:, 0]
    )
    unit = FittedEffect(effect, variant, inner, np.ones(len(variant.columns)), 0.0)
    ours, whole = [], []
    for frequency in FREQUENCIES:
        time = np.arange(0, 3 / frequency, 2e-4)
        w = 2 * np.pi * frequency
        motion = peak * np.sin(w * time), peak * w * np.cos(w * time)
        ours.append(transfer_moment(effect_law([unit], frequency), *motion, 5000.0)[0])
        whole.append(transfer_moment(INTER_PANEL, *motion, 5000.0)[0])
    size = SHARE * np.std(np.concatenate(whole)) / np.std(np.concatenate(ours))
    return effect_law([FittedEffect(effect, variant, inner, np.full(len(variant.columns), size), 0.0)], 0.0)
