"""One law, or fault of a channel, for every effect of the shipped catalogues, from its formula in the literature."""

from __future__ import annotations

import numpy as np

from tests.doors.truth import LAW, Truth

A, V = 7e-4, 0.024  # rad and rad/s, the largest of the campaigns


def _sum(f):
    return Truth(hidden=f)


def _states(count, slope, moment):
    return Truth(states=(count, slope, moment))


def _dahl(t, a, v, z):
    return v / (0.15 * A) * (1 - np.sign(v) * z)


def _bouc_wen(t, a, v, z):
    return (v - (0.5 * abs(v) * z * abs(z) + 0.5 * v * z**2)) / (0.25 * A)


def _slider(t, a, v, z):
    held = (z >= 1) & (v > 0) | (z <= -1) & (v < 0)
    return np.where(held, 0.0, v / (0.25 * A))


# Twelve sliders of even yields, of equal stiffness.
YIELDS = 0.6 * A * np.arange(1, 13) / 12


def _sliders(a, v, t):
    z, moments = np.zeros(12), []
    for step in np.diff(np.concatenate([a[::-1], a]), prepend=a[-1]):
        z = np.clip(z + step, -YIELDS, YIELDS)
        moments.append(300 * z.sum())
    return np.array(moments[a.size :])


def _lugre(t, a, v, z):
    level = 1 + 0.35 * np.exp(-((v / (0.12 * V)) ** 2))
    return v / (0.08 * A) * (1 - np.sign(v) * z / level)


def _play(t, a, v, z):
    end = 0.4 * A
    return np.where((z >= end) & (v > 0) | (z <= -end) & (v < 0), 0.0, v)


def _play_moment(a, v, z):
    return 0.6 * np.sign(z[0]) * np.clip((abs(z[0]) - 0.3 * A) / (0.1 * A), 0, 1)


# A power law of branches over the times of the test; a derivative of fractional order has no other finite state.
TIMES = np.geomspace(1e-3, 3.0, 8)


def _branches(t, a, v, z):
    return v - z / TIMES


# 5 to 15 % of the moment's RMS of 3 N·m each.
HIDDEN = {
    "quintic_stiffness": _sum(lambda a, v, t: 1.2 * (a / A) ** 5),
    "bilinear_stiffness": _sum(lambda a, v, t: 700 * np.maximum(a, 0)),
    "dead_zone": _sum(lambda a, v, t: -3000 * np.clip(a, -0.12 * A, 0.12 * A)),
    "constant_moment": _sum(lambda a, v, t: 0.25),
    "direction_dependent_damping": _sum(lambda a, v, t: 12 * abs(v)),
    "quadratic_damping": _sum(lambda a, v, t: 0.7 * v * abs(v) / V**2),
    "cubic_damping": _sum(lambda a, v, t: 0.8 * (v / V) ** 3),
    "amplitude_dependent_damping": _sum(lambda a, v, t: 1.5 * (a / A) ** 2 * v / V),
    "position_dependent_friction": _sum(lambda a, v, t: 0.6 * abs(a) / A * np.sign(v)),
    "one_sided_friction": _sum(lambda a, v, t: 0.6 * a / A * np.sign(v)),
    "stribeck_friction": _sum(lambda a, v, t: 0.6 * np.exp(-abs(v) / (0.12 * V)) * np.sign(v)),
    "dahl_friction": _states(1, _dahl, lambda a, v, z: 0.5 * z[0]),
    "bouc_wen_hysteresis": _states(1, _bouc_wen, lambda a, v, z: 0.5 * z[0]),
    "jenkins_element": _states(1, _slider, lambda a, v, z: 0.5 * z[0]),
    "iwan_microslip": _sum(_sliders),
    "lugre_friction": _states(1, _lugre, lambda a, v, z: 0.5 * z[0]),
    "backlash_play": _states(1, _play, _play_moment),
    "maxwell_branch": _states(1, lambda t, a, v, z: v - z / 0.03, lambda a, v, z: 900 * z[0]),
    "fractional_damping": _states(8, _branches, lambda a, v, z: 150 * (TIMES ** -0.4) @ z),
    "quadratic_stiffness": _sum(lambda a, v, t: 0.6 * (a / A) ** 2),
    "cubic_stiffness": _sum(lambda a, v, t: 0.8 * (a / A) ** 3),
    "linear_damping": Truth(),
    "coulomb_friction": Truth(),
    "inertia_error": Truth(inertia=1.6),
    "frequency_dependent_stiffness": Truth(),
    "stiffness_drift": Truth(hidden=lambda a, v, t: 600 * t / 8 * a, seconds=8.0, frequencies=(3.0, 5.5)),
    "moment_drift": _sum(lambda a, v, t: 0.25 * t),
    "angle_drift": Truth(),
    "angle_offset": Truth(law={**LAW, "cubic_stiffness": 2.5e9}),
    "channel_delay": Truth(delay=0.003),
}  # fmt: skip

#: Terms of the model to begin with, by name of the paper's; default all five.
LACKS = {
    name: name for name in ("linear_damping", "coulomb_friction", "quadratic_stiffness", "cubic_stiffness")
}


def runs_of(name):
    """Return the runs of a campaign in which an effect is hidden."""
    made = HIDDEN[name].runs(seed=len(name))
    for run in made:
        time = np.arange(run.angle.size) / 500.0
        if name == "frequency_dependent_stiffness":
            run.moment = run.moment + 250 * (run.frequency - 4) * run.angle
        elif name == "angle_drift":
            run.angle = run.angle + 2e-5 * time
        elif name == "angle_offset":
            run.angle = run.angle + 1e-4
    return made
