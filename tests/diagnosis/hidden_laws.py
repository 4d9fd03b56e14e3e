"""Laws that are hidden in virtual tests, written for the simulator alone; see tests/diagnosis/hidden_effects.py.

Functions of scalars: parameters p[0] is the size, the rest the inner ones.
"""

import numpy as np


def _quintic(theta, omega, direction, state, p, out):
    out[0] = p[0] * theta**5


def _bilinear(theta, omega, direction, state, p, out):
    out[0] = p[0] * max(theta, 0.0)


def _clearance(theta, omega, direction, state, p, out):
    out[0] = -p[0] * min(max(theta, -p[1]), p[1])


def _stop(theta, omega, direction, state, p, out):
    out[0] = p[0] * (max(theta - p[1], 0.0) - max(-theta - p[1], 0.0))


def _constant(theta, omega, direction, state, p, out):
    out[0] = p[0]


def _direction(theta, omega, direction, state, p, out):
    out[0] = p[0] * abs(omega)


def _quadratic(theta, omega, direction, state, p, out):
    out[0] = p[0] * omega * abs(omega)


def _cubic(theta, omega, direction, state, p, out):
    out[0] = p[0] * omega**3


def _amplitude(theta, omega, direction, state, p, out):
    out[0] = p[0] * theta**2 * omega


def _position(theta, omega, direction, state, p, out):
    out[0] = p[0] * abs(theta) * direction


def _stribeck(theta, omega, direction, state, p, out):
    out[0] = p[0] * np.exp(-abs(omega) / p[1]) * direction


def _dahl(theta, omega, direction, state, p, out):
    out[0] = p[0] * state[0]
    out[1] = omega / p[1] * (1.0 - direction * state[0])


def _bouc_wen(theta, omega, direction, state, p, out):
    z = state[0]
    out[0] = p[0] * z
    out[1] = (omega - abs(z) ** p[2] * (0.5 * direction * np.sign(z) + 0.5) * omega) / p[1]


def _bouc_wen_general(theta, omega, direction, state, p, out):
    """z' = θ̇·(1 − (sgn(θ̇z) + p3 − 2)·|z|^p2)/p1; with p3 of 3 the one above, its yield that of both parts alike."""
    z = state[0]
    out[0] = p[0] * z
    out[1] = omega * (1.0 - (direction * np.sign(z) + p[3] - 2.0) * abs(z) ** p[2]) / p[1]


def _jenkins(theta, omega, direction, state, p, out):
    out[0] = p[0] * state[0]
    yielding = (state[0] >= 1.0 and omega > 0) or (state[0] <= -1.0 and omega < 0)
    out[1] = 0.0 if yielding else omega / p[1]


def _iwan(theta, omega, direction, state, p, out):
    """Twelve sliders, of yields even up to p[1] and stiffnesses by a power law of them: more than any model has."""
    whole = 0.0
    out[0] = 0.0
    for i in range(12):
        share = (i + 0.5) / 12
        weight = share ** (p[2] - 1.0)
        whole += weight * share
        out[0] += weight * state[i]
        yielding = (state[i] >= share and omega > 0) or (state[i] <= -share and omega < 0)
        out[1 + i] = 0.0 if yielding else omega / p[1]
    out[0] *= p[0] / whole


def _one_sided_stop(theta, omega, direction, state, p, out):
    out[0] = p[0] * max(p[2] * theta - p[1], 0.0) * p[2]


def _lugre(theta, omega, direction, state, p, out):
    g = 1.0 + p[2] * np.exp(-((omega / p[3]) ** 2))
    out[0] = p[0] * state[0]
    out[1] = omega / p[1] * (1.0 - direction * state[0] / g)


def _play(theta, omega, direction, state, p, out):
    z = state[0]
    out[0] = p[0] * np.sign(z) * min(max((abs(z) - p[1]) / p[2], 0.0), 1.0)
    end = p[1] + p[2]
    out[1] = 0.0 if (z >= end and omega > 0) or (z <= -end and omega < 0) else omega


def _maxwell(theta, omega, direction, state, p, out):
    out[0] = p[0] * state[0]
    out[1] = omega - state[0] / p[1]


def _ripple(theta, omega, direction, state, p, out):
    out[0] = p[0] * np.sin(theta / p[1])


def _resonance(theta, omega, direction, state, p, out):
    """A second oscillator behind the joint, q'' = w²(θ − q) − 2ζw q': passive, damped against the ground.

    The states are q + q'/w and q'/w, so that both begin to move with the joint: the simulator measures errors by the
    largest value so far, and q itself starts with the fourth power of time.
    """
    w, swing = p[1], state[1]
    q = state[0] - swing
    rate = w * (theta - q) - 2 * p[2] * w * swing
    out[0] = p[0] * (theta - q)
    out[1] = w * swing + rate
    out[2] = rate


def _cogging(theta, omega, direction, state, p, out):
    """Friction that comes and goes along the angle."""
    out[0] = p[0] * np.cos(theta / p[1]) * direction


def _modulus(theta, omega, direction, state, p, out):
    """Damping with |θ|: between two effects of the catalogue."""
    out[0] = p[0] * abs(theta) * omega


def _cross(theta, omega, direction, state, p, out):
    """A moment with θ·θ̇², as of a mass whose lever changes with the angle."""
    out[0] = p[0] * theta * omega**2


def _lag(theta, omega, direction, state, p, out):
    """Friction that builds up with the time since the reversal, not with the way."""
    out[0] = p[0] * state[0]
    out[1] = (np.tanh(omega / p[2]) - state[0]) / p[1]


def _relay(theta, omega, direction, state, p, out):
    """A moment that flips once the angle has passed ±p[1], and stays until it has passed the other: a detent."""
    side = 1.0 if state[0] >= 0 else -1.0
    if theta > p[1]:
        side = 1.0
    elif theta < -p[1]:
        side = -1.0
    out[0] = p[0] * state[0]
    out[1] = (side - state[0]) / 0.003


def _breathing(theta, omega, direction, state, p, out):
    """Stiffness modulated at a frequency of its own, p[1] rad/s; the state is a clock."""
    out[0] = p[0] * np.sin(p[1] * state[0]) * theta
    out[1] = 1.0


# name: (law, states, inner parameters drawn from peak angle, peak rate and a generator)
LAWS = {
    "quintic_stiffness": (_quintic, 0, lambda a, v, g: ()),
    "bilinear_stiffness": (_bilinear, 0, lambda a, v, g: ()),
    "dead_zone": (_clearance, 0, lambda a, v, g: (a * g.uniform(0.04, 0.15),)),
    "stop": (_stop, 0, lambda a, v, g: (a * g.uniform(0.5, 0.75),)),
    "one_sided_stop": (_one_sided_stop, 0, lambda a, v, g: (a * g.uniform(0.2, 0.7), g.choice([-1.0, 1.0]))),
    "constant_moment": (_constant, 0, lambda a, v, g: ()),
    "direction_dependent_damping": (_direction, 0, lambda a, v, g: ()),
    "quadratic_damping": (_quadratic, 0, lambda a, v, g: ()),
    "cubic_damping": (_cubic, 0, lambda a, v, g: ()),
    "amplitude_dependent_damping": (_amplitude, 0, lambda a, v, g: ()),
    "position_dependent_friction": (_position, 0, lambda a, v, g: ()),
    "stribeck_friction": (_stribeck, 0, lambda a, v, g: (v * g.uniform(0.05, 0.25),)),
    "dahl_friction": (_dahl, 1, lambda a, v, g: (a * g.uniform(0.03, 0.3),)),
    "bouc_wen_hysteresis": (
        _bouc_wen,
        1,
        lambda a, v, g: (a * g.uniform(0.05, 0.4), g.choice([1.0, 1.5, 2.0])),
    ),
    # Numbers inside the ranges of the catalogue, whose ends (shape 3 and, with the first power, 2) are other laws.
    "bouc_wen_general": (
        _bouc_wen_general,
        1,
        lambda a, v, g: (
            a * g.uniform(0.05, 0.4),
            n := g.choice([1.0, 2.0]),
            g.uniform(1.2, 1.55) if n == 1.0 and g.uniform() < 0.5 else g.uniform(2.45, 2.9),
        ),
    ),
    "jenkins_element": (_jenkins, 1, lambda a, v, g: (a * g.uniform(0.05, 0.4),)),
    "iwan_microslip": (_iwan, 12, lambda a, v, g: (a * g.uniform(0.2, 1.0), g.uniform(0.2, 1.2))),
    "lugre_friction": (
        _lugre,
        1,
        lambda a, v, g: (a * g.uniform(0.03, 0.2), g.uniform(0.1, 0.4), v * g.uniform(0.05, 0.2)),
    ),
    "backlash_play": (_play, 1, lambda a, v, g: (a * g.uniform(0.1, 0.4), a * g.uniform(0.02, 0.1))),
    "maxwell_branch": (_maxwell, 1, lambda a, v, g: (g.uniform(0.015, 0.06),)),
    "ripple": (_ripple, 0, lambda a, v, g: (a * g.uniform(0.02, 0.05),)),
    "friction_ripple": (_cogging, 0, lambda a, v, g: (a * g.uniform(0.03, 0.08),)),
    "modulus_damping": (_modulus, 0, lambda a, v, g: ()),
    "second_resonance": (
        _resonance,
        2,
        lambda a, v, g: (2 * np.pi * g.uniform(7.5, 14), g.uniform(0.02, 0.1)),
    ),
    "rate_squared_stiffness": (_cross, 0, lambda a, v, g: ()),
    "friction_lag": (_lag, 1, lambda a, v, g: (g.uniform(0.004, 0.015), 1e-3 * v)),
    "relay": (_relay, 1, lambda a, v, g: (a * g.uniform(0.1, 0.3),)),
    "breathing_stiffness": (_breathing, 1, lambda a, v, g: (2 * np.pi * g.uniform(0.7, 1.7),)),
}
