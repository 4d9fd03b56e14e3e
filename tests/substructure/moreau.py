"""An independent time integration of two beams with a joint between them and a mass at their end.

Own assembly, Moreau's time stepping: the implicit midpoint rule for the beams, with the joint's friction projected onto
its interval in each step. Nothing of the package is used.
"""

import numpy as np
from scipy.linalg import eigh

HALF = 0.5  # m, of each beam
BENDING, PER_LENGTH, TIP = 70e9 * 0.05 * 0.02**3 / 12, 2700 * 0.05 * 0.02, 8.0
ELEMENTS = 4


def matrices(loss, k1):
    """Return M, C and K of the joint's angle and then (w, φ) at each node; C has the loss at the first mode."""
    a, size = HALF / ELEMENTS, 1 + 4 * ELEMENTS
    stiff = np.array(
        [[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a],
         [-12, -6 * a, 12, -6 * a], [6 * a, 2 * a * a, -6 * a, 4 * a * a]]
    )  # fmt: skip
    heavy = np.array(
        [[156, 22 * a, 54, -13 * a], [22 * a, 4 * a * a, 13 * a, -3 * a * a],
         [54, 13 * a, 156, -22 * a], [-13 * a, -3 * a * a, -22 * a, 4 * a * a]]
    )  # fmt: skip
    mass, stiffness = np.zeros((2, size, size))
    for element in range(2 * ELEMENTS):
        local = np.zeros((4, size))
        for end, node in ((0, element), (2, element + 1)):
            if node:
                local[[end, end + 1], [2 * node - 1, 2 * node]] = 1.0
        if element == ELEMENTS:
            local[1, 0] = 1.0
        stiffness += local.T @ stiff @ local * BENDING / a**3
        mass += local.T @ heavy @ local * PER_LENGTH * a / 420
    mass[-2, -2] += TIP
    sliding = stiffness.copy()
    sliding[0, 0] += k1
    first = np.sqrt(eigh(sliding, mass, eigvals_only=True)[0])
    return mass, loss * stiffness / first, stiffness


def steady(law, loss, cases, periods, steps):
    """Return amplitudes of the tip's first harmonic, m, and of the angle, rad, under forces (N, Hz) from rest."""
    k1, k2, k3, c1, friction = law
    mass, damping, stiffness = matrices(loss, k1)
    n = len(mass)
    force, frequency = np.array(cases).T
    step = 1 / frequency / steps
    # Middle velocity u = a·(M v − h/2·K q + h/2·(p − joint)), then q + h·u and 2u − v.
    h = step[:, None, None]
    a = np.linalg.inv(mass + h / 2 * damping + h * h / 4 * stiffness)
    from_state = np.concatenate([-h / 2 * a @ stiffness, a @ mass], axis=2)
    one = np.eye(2 * n)
    advance = np.concatenate([one[:n] + h * from_state, 2 * from_state - one[n:]], axis=1)
    by_push, by_joint = (
        np.concatenate([step[:, None] * c, 2 * c], axis=1) * step[:, None] / 2
        for c in (a[:, :, -2], -a[:, :, 0])
    )
    first_row, own, other = from_state[:, 0], a[:, 0, 0] * step / 2, a[:, 0, -2] * step / 2
    state, shown = np.zeros((len(force), 2 * n)), np.zeros((2, steps, len(force)))
    for _ in range(periods):
        for i in range(steps):
            push = force * np.cos(2 * np.pi * (i + 0.5) / steps)
            free = np.einsum("ki,ki->k", first_row, state) + other * push
            rate, angle = 0.0, state[:, 0]
            for _ in range(3):
                x = angle + step / 2 * rate
                slope = k1 + x * (2 * k2 + 3 * k3 * x)
                rest = x * (k1 + x * (k2 + x * k3)) - slope * step / 2 * rate
                stop = (free - own * rest) / own  # friction that would hold the joint
                hold = np.clip(stop, -friction, friction)
                rate = own * (stop - hold) / (1 + own * (slope * step / 2 + c1))
            x = angle + step / 2 * rate
            joint = x * (k1 + x * (k2 + x * k3)) + c1 * rate + hold
            state = (
                np.einsum("kij,kj->ki", advance, state) + by_push * push[:, None] + by_joint * joint[:, None]
            )
            shown[:, i] = state[:, n - 2], state[:, 0]
    turns = np.exp(-2j * np.pi * np.arange(steps) / steps)
    return 2 * np.abs(turns @ shown[0]) / steps, np.ptp(shown[1], axis=0) / 2
