"""Laws of joints written anew from the literature, as ordinary differential equations for a general solver.

Nothing here comes from ``sindyjoint``: friction is regularised, sliders and contacts are smooth or stiff differential
equations, hysteresis is in its differential form. Each entry draws the numbers of one law, in units of a peak
displacement ``a`` and a peak rate ``v``, and returns the number of its states and a function
``law(t, x, w, z) → (moment of unit size, rates of the states)``.
"""

from math import cos, exp, log, pi, sin, tanh

# Rates below this share of the peak have no definite sign: the regularisation of dry friction. A joint that is held
# creeps by it: at 2e-3 its angle differs by 1 to 4 % from that of dry friction where it stands still between pulls,
# many times the noise, and the law is then none of the catalogue; at 2e-4 by 0.5 %.
SMALL = 2e-4


def _plain(function):
    """A law without memory."""
    return 0, lambda t, x, w, z: (function(x, w), ())


def _clip(value, limit):
    return max(-limit, min(limit, value))


# --- Effects that the catalogue has, by the name it has for them -----------------------------------------------------


def quintic_stiffness(a, v, rng):
    return _plain(lambda x, w: (x / a) ** 5)


def bilinear_stiffness(a, v, rng):
    side = rng.choice([-1.0, 1.0])
    return _plain(lambda x, w: max(side * x, 0.0) * side / a)


def clearance(a, v, rng):
    gap = rng.uniform(0.06, 0.2) * a
    return _plain(lambda x, w: (x - _clip(x, gap)) / a)


def stop(a, v, rng):
    gap = rng.uniform(0.5, 0.75) * a
    return _plain(lambda x, w: (x - _clip(x, gap)) / a)


def direction_dependent_damping(a, v, rng):
    forth, back = rng.uniform(0.2, 1.0), rng.uniform(1.5, 3.0)
    return _plain(lambda x, w: (forth if w > 0 else back) * w / v)


def quadratic_damping(a, v, rng):
    return _plain(lambda x, w: w * abs(w) / v**2)


def cubic_damping(a, v, rng):
    return _plain(lambda x, w: (w / v) ** 3)


def amplitude_dependent_damping(a, v, rng):
    return _plain(lambda x, w: (x / a) ** 2 * w / v)


def position_dependent_friction(a, v, rng):
    return _plain(lambda x, w: abs(x) / a * tanh(w / (SMALL * v)))


def stribeck_friction(a, v, rng):
    slow = rng.uniform(0.06, 0.25) * v
    return _plain(lambda x, w: tanh(w / (SMALL * v)) * exp(-abs(w) / slow))


def dahl_friction(a, v, rng):
    """Dahl 1968, dF/dx = σ(1 − F/F_c·sgn ẋ)."""
    yields = rng.uniform(0.05, 0.35) * a
    return 1, lambda t, x, w, z: (z[0], ((w - abs(w) * z[0]) / yields,))


def bouc_wen_hysteresis(a, v, rng):
    """Wen 1976 with β = γ: ż = (ẋ − β|ẋ||z|ⁿ⁻¹z − γẋ|z|ⁿ)/x_y."""
    yields, power = rng.uniform(0.1, 0.4) * a, rng.choice([1.0, 2.0])

    def law(t, x, w, z):
        bent = abs(z[0]) ** power
        side = 1.0 if z[0] >= 0 else -1.0
        return z[0], ((w - 0.5 * abs(w) * bent * side - 0.5 * w * bent) / yields,)

    return 1, law


def jenkins_element(a, v, rng):
    """Spring and slider, the slider a stiff viscous law beyond its limit (Perzyna's overstress)."""
    yields = rng.uniform(0.1, 0.4) * a
    quick = 2e-4

    def law(t, x, w, z):
        force = _clip((x - z[0]) / yields, 3.0)
        over = force - _clip(force, 1.0)
        return force, (yields * over / quick,)

    return 1, law


def lugre_friction(a, v, rng):
    """Canudas de Wit et al. 1995, without σ_1."""
    yields, rise, slow = rng.uniform(0.04, 0.2) * a, rng.uniform(0.2, 0.5), rng.uniform(0.05, 0.2) * v

    def law(t, x, w, z):
        level = 1.0 + rise * exp(-((w / slow) ** 2))
        return z[0], ((w - abs(w) * z[0] / level) / yields,)

    return 1, law


def backlash_play(a, v, rng):
    """A slider reached through a clearance: stiff contact on either side of a driven block with dry friction."""
    gap, ramp = rng.uniform(0.12, 0.35) * a, rng.uniform(0.03, 0.08) * a
    quick = 2e-4

    def law(t, x, w, z):
        # The block follows where the contact is fully pressed; the contact's force saturates at the friction.
        travel = _clip(x - z[0], 3 * (gap + ramp))
        pressed = max(abs(travel) - gap, 0.0) / ramp
        side = 1.0 if travel > 0 else -1.0
        return side * min(pressed, 1.0), (side * max(pressed - 1.0, 0.0) * ramp / quick,)

    return 1, law


def maxwell_branch(a, v, rng):
    """In the form of its force: Ḟ = kẋ − F/τ."""
    forget = rng.uniform(0.02, 0.08)
    return 1, lambda t, x, w, z: (z[0], (w / v - z[0] / forget,))


def fractional_damping(a, v, rng):
    """Diffusive representation of a fractional derivative (Montseny 1998), twelve poles of equal logarithmic steps."""
    order = rng.uniform(0.3, 0.7)
    poles = [2 * pi * 0.02 * 10 ** (4.5 * k / 11) for k in range(12)]
    weight = [p**order for p in poles]

    def law(t, x, w, z):
        moment = sum(g * q for g, q in zip(weight, z, strict=True)) / (a * poles[5] ** order)
        return moment, tuple(w - p * q for p, q in zip(poles, z, strict=True))

    return 12, law


def stiffness_drift(a, v, rng):
    """A stiffness that changes steadily along each run; its clock is the solver's time."""
    way = rng.choice([-1.0, 1.0])
    return 0, lambda t, x, w, z: (way * 0.2 * t * x / a, ())


CATALOGUE = {
    "quintic_stiffness": quintic_stiffness,
    "bilinear_stiffness": bilinear_stiffness,
    "clearance": clearance,
    "stop": stop,
    "direction_dependent_damping": direction_dependent_damping,
    "quadratic_damping": quadratic_damping,
    "cubic_damping": cubic_damping,
    "amplitude_dependent_damping": amplitude_dependent_damping,
    "position_dependent_friction": position_dependent_friction,
    "stribeck_friction": stribeck_friction,
    "dahl_friction": dahl_friction,
    "bouc_wen_hysteresis": bouc_wen_hysteresis,
    "jenkins_element": jenkins_element,
    "lugre_friction": lugre_friction,
    "backlash_play": backlash_play,
    "maxwell_branch": maxwell_branch,
    "fractional_damping": fractional_damping,
    "stiffness_drift": stiffness_drift,
}
# What happens to the channels of a joint without any further law.
CHANNELS = ("channel_delay", "inertia_error", "sensor_zero")
# Names that count as right, where they are not the effect's own: the class of the same moment under another name.
SAME = {
    "clearance": {"dead_zone", "hard_stop"},
    "stop": {"dead_zone", "hard_stop"},
    "sensor_zero": {"angle_offset", "constant_moment"},
    "mujoco:spring_limit": {"dead_zone", "hard_stop"},
    "mujoco:viscous_fluid": {"quadratic_damping"},
}


# --- Laws that no catalogue of the package holds ----------------------------------------------------------------------


def reversal_memory(a, v, rng):
    """A moment that remembers where the motion last turned round."""
    turn, catch = 0.04 * v, 2e-3
    return 1, lambda t, x, w, z: (tanh(1.5 * z[0] / a), ((x - z[0]) / catch * exp(-((w / turn) ** 2)),))


def ageing_friction(a, v, rng):
    """Rate and state with ageing (Dieterich 1979; Ruina 1983): μ = 1 + A·ln(1 + ψ/ψ_0), ψ̇ = 1 − |ẋ|ψ/L."""
    length, age, strength = rng.uniform(0.1, 0.6) * a, rng.uniform(0.002, 0.02), rng.uniform(0.5, 1.0)

    def law(t, x, w, z):
        friction = 0.1 + strength * log(1.0 + max(z[0], 0.0) / age)
        return friction * tanh(w / (SMALL * v)), (1.0 - abs(w) * z[0] / length,)

    return 1, law


def detents(a, v, rng):
    """Triangular detents along the way."""
    pitch, shift = rng.uniform(0.12, 0.5) * a, rng.uniform(0, 1)

    def force(x, w):
        place = (x / pitch + shift) % 1.0
        return 1.0 - 4.0 * abs(place - 0.5)

    return _plain(force)


def friction_ripple(a, v, rng):
    pitch, shift = rng.uniform(0.15, 0.6) * a, rng.uniform(0, 2 * pi)
    return _plain(lambda x, w: cos(2 * pi * x / pitch + shift) * tanh(w / (SMALL * v)))


def second_oscillator(a, v, rng):
    """Another degree of freedom behind a spring, with its own resonance within the drive's band."""
    pulse, loss = 2 * pi * rng.uniform(1.5, 7.0), rng.uniform(0.02, 0.1)

    def law(t, x, w, z):
        return (x - z[0]) / a, (z[1], pulse**2 * (x - z[0]) - 2 * loss * pulse * z[1])

    return 2, law


def chaotic_oscillator(a, v, rng):
    """Holmes' buckled beam behind the joint: a freedom with two wells that jumps between them."""
    pulse, loss = 2 * pi * rng.uniform(1.0, 3.0), rng.uniform(0.05, 0.2)

    def law(t, x, w, z):
        pull = z[0] - z[0] ** 3 + 0.8 * x / a
        return x / a - z[0], (z[1], pulse**2 * pull - 2 * loss * pulse * z[1])

    return 2, law


def own_rhythm(a, v, rng):
    """A stiffness pumped by a van der Pol oscillator of its own."""
    pulse = 2 * pi * rng.uniform(0.4, 2.5)

    def law(t, x, w, z):
        # From rest it would never begin: a small push starts it.
        push = 1e-2 * pulse**2 * exp(-t)
        return (1.0 + 0.5 * z[0]) * x / a, (z[1], pulse * (1 - z[0] ** 2) * z[1] - pulse**2 * z[0] + push)

    return 2, law


def thermal_softening(a, v, rng):
    """A stiffness that falls with the heat of the work done, which leaks away."""
    leak, heat = rng.uniform(0.5, 2.5), rng.uniform(2.0, 6.0)
    return 1, lambda t, x, w, z: (x / a / (1.0 + max(z[0], 0.0)), (heat * (w / v) ** 2 - z[0] / leak,))


def hot_friction(a, v, rng):
    """Friction that falls as it heats its own contact."""
    leak, heat = rng.uniform(0.3, 1.5), rng.uniform(3.0, 10.0)
    return 1, lambda t, x, w, z: (
        tanh(w / (SMALL * v)) / (1.0 + max(z[0], 0.0)),
        (heat * abs(w) / v - z[0] / leak,),
    )


def asymmetric_hysteresis(a, v, rng):
    """Bouc-Wen with unlike branches (Dobson et al. 1997): how it yields depends on the side of x, of z and of ẋ."""
    yields, skew, shift = rng.uniform(0.15, 0.5) * a, rng.uniform(0.6, 0.9), rng.uniform(0.3, 0.6)

    def law(t, x, w, z):
        forward = 1.0 if w > 0 else -1.0
        outward = 1.0 if x > 0 else -1.0
        level = 1.0 + skew * forward * outward + shift * outward
        level = max(level, 0.15)
        return z[0], ((w - abs(w) * z[0] / level) / yields,)

    return 1, law


def pinching(a, v, rng):
    """Pinched hysteresis (Baber and Noori 1986): the spring is slack about the middle on the way back."""
    yields, slack = rng.uniform(0.1, 0.3) * a, rng.uniform(0.15, 0.3) * a

    def law(t, x, w, z):
        open_ = 1.0 - 0.95 * exp(-((x / slack) ** 2))
        return z[0], (open_ * (w - abs(w) * z[0]) / yields,)

    return 1, law


def rebound(a, v, rng):
    """A one-sided stop that dissipates on impact (Hunt and Crossley 1975)."""
    gap, loss = rng.uniform(0.1, 0.4) * a, rng.uniform(1.0, 3.0)
    return _plain(lambda x, w: max(x - gap, 0.0) ** 1.5 / a**1.5 * max(1.0 + loss * w / v, 0.0))


def two_states(a, v, rng):
    """A bistable element that snaps to the other state beyond an angle, and saturates."""
    trigger, quick = rng.uniform(0.2, 0.5) * a, 0.004
    return 1, lambda t, x, w, z: (z[0], ((tanh(4.0 * (0.6 * z[0] + 0.6 * x / trigger)) - z[0]) / quick,))


def friction_lag(a, v, rng):
    """Friction that builds up with the time since the reversal, not with the way."""
    lag = rng.uniform(0.02, 0.08)
    return 1, lambda t, x, w, z: (z[0], ((tanh(w / (SMALL * v)) - z[0]) / lag,))


def late_spring(a, v, rng):
    """A spring that answers late (second-order Padé approximation of a pure delay)."""
    lag = rng.uniform(0.04, 0.12)

    def law(t, x, w, z):
        # d/dt of the filter (1 − sτ/2 + s²τ²/12)/(1 + sτ/2 + s²τ²/12) in controllable form.
        top = x - z[0] - z[1] * lag / 2
        return (x - z[1] * lag) / a, (z[1], 12 * top / lag**2)

    return 2, law


def wear(a, v, rng):
    """Friction that grows with the way that was travelled, and is healed by rest."""
    way, heal = rng.uniform(2.0, 6.0) * a, rng.uniform(0.3, 1.0)
    return 1, lambda t, x, w, z: (
        tanh(w / (SMALL * v)) * z[0] ** 2,
        (abs(w) / way - z[0] / heal,),
    )


def creeping_centre(a, v, rng):
    """A spring whose centre creeps after the joint by thresholds: a plastic set that saturates."""
    reach, speed = rng.uniform(0.2, 0.5) * a, rng.uniform(4.0, 15.0)

    def law(t, x, w, z):
        off = x - z[0]
        return off * abs(off) / a**2, (speed * (off - _clip(off, reach)) * (1 + abs(w) / v),)

    return 1, law


def coupled_shear(a, v, rng):
    """Another direction in which the joint can move, nonlinearly coupled: M = x·y, ÿ driven by x²."""
    pulse, loss = 2 * pi * rng.uniform(1.0, 6.0), rng.uniform(0.02, 0.1)

    def law(t, x, w, z):
        return x * z[0] / a, (z[1], pulse**2 * ((x / a) ** 2 - z[0]) - 2 * loss * pulse * z[1])

    return 2, law


def logarithmic_creep(a, v, rng):
    """A moment with the logarithm of the rate, whose middle wanders with the mean rate."""
    slow, lag = 0.03 * v, rng.uniform(0.1, 0.4)

    def law(t, x, w, z):
        off = w - z[0]
        side = 1.0 if off > 0 else -1.0
        return side * log(1.0 + abs(off) / slow) / 3.5, (((w * abs(x) / a) - z[0]) / lag,)

    return 1, law


def twin_well(a, v, rng):
    """Ripples that grow outward: sin(x²)."""
    turns = rng.uniform(3.0, 8.0)
    return _plain(lambda x, w: sin(turns * (x / a) * abs(x / a) + 0.5))


FOREIGN = {
    "reversal_memory": reversal_memory,
    "ageing_friction": ageing_friction,
    "detents": detents,
    "friction_ripple": friction_ripple,
    "second_oscillator": second_oscillator,
    "chaotic_oscillator": chaotic_oscillator,
    "own_rhythm": own_rhythm,
    "thermal_softening": thermal_softening,
    "hot_friction": hot_friction,
    "asymmetric_hysteresis": asymmetric_hysteresis,
    "pinching": pinching,
    "rebound": rebound,
    "two_states": two_states,
    "friction_lag": friction_lag,
    "late_spring": late_spring,
    "wear": wear,
    "creeping_centre": creeping_centre,
    "coupled_shear": coupled_shear,
    "logarithmic_creep": logarithmic_creep,
    "twin_well": twin_well,
}
