"""A virtual test of the inter-panel joint in which the seed hides an effect."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import load_effects, select_effects
from sindyjoint.diagnosis.effects.fitted import FittedEffect, effect_law
from sindyjoint.equation.terms import Reference
from sindyjoint.mechanics.laws import INTER_PANEL, Law
from sindyjoint.mechanics.stickslip import transfer_moment
from sindyjoint.mechanics.virtual import LEVELS, virtual_campaign
from sindyjoint.numeric import RNG
from sindyjoint.paper import FREQUENCIES
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


def hidden_campaign(rng: RNG = None) -> tuple[Campaign, str]:
    """Return a virtual test and the name of the effect, of 6 % of the moment's RMS, that the seed hid in it."""
    generator = np.random.default_rng(0 if rng is None else rng)
    name = str(generator.choice(CHOICES))
    peak = LEVELS[0] * INTER_PANEL.softening_angle
    law = None if name == "nothing" else hidden_law(name, INTER_PANEL, peak, FREQUENCIES, generator)
    campaign = virtual_campaign(INTER_PANEL, hidden=law, noise=0.01, rng=generator, duration=8.0)
    return campaign, name


def hidden_law(
    name: str,
    law: Law,
    peak: float,
    frequencies: Sequence[float],
    generator: np.random.Generator,
    share: float = SHARE,
) -> Any:
    """Return the law of an effect of a joint, with nonlinear parameters drawn within their bounds.

    Parameters
    ----------
    name : str
        Of the effect.
    law : Law
        The joint.
    peak : float
        Angle, rad, of the motion in which the effect has its share.
    frequencies : sequence of float
        Of that motion, Hz.
    generator : Generator
    share : float
        RMS of what the effect adds, of the moment's.
    """
    reference = Reference(peak, 2 * np.pi * max(frequencies) * peak)
    effect = select_effects(load_effects(), [name])[0]
    variant = effect.variants[0]
    bounds = np.log(variant.bounds(reference)).reshape(-1, 2)
    inner = np.exp(
        bounds[:, 0] + generator.uniform(0.4, 0.7, bounds.shape[0]) * np.diff(bounds, axis=1)[:, 0]
    )
    unit = FittedEffect(effect, variant, inner, np.ones(len(variant.columns)), 0.0)
    ours, whole = [], []
    for frequency in frequencies:
        time = np.arange(0, 3 / frequency, 2e-4)
        w = 2 * np.pi * frequency
        motion = peak * np.sin(w * time), peak * w * np.cos(w * time)
        ours.append(transfer_moment(effect_law([unit], frequency), *motion, 5000.0)[0])
        whole.append(transfer_moment(law, *motion, 5000.0)[0])
    size = share * np.std(np.concatenate(whole)) / np.std(np.concatenate(ours))
    return effect_law([FittedEffect(effect, variant, inner, np.full(len(variant.columns), size), 0.0)], 0.0)
