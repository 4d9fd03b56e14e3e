"""What is said beside a result: warnings, and what a campaign cannot show, each with the number that caused it."""

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.discovery.delay import ChannelDelay, said_of_removed
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.limits import EQUATION, SOUNDNESS
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates
from sindyjoint.text import in_words_of, list_some, quantities

DAMPING = {"rotation": "N*m*s/rad", "translation": "N*s/m"}
OFFSET_FAMILY = ("constant_moment", "quadratic_stiffness")


def list_warnings(
    campaign: Campaign,
    states: Sequence[ForceStates],
    model: JointModel,
    delay: ChannelDelay | None,
    aligned: bool,
    indistinct: Sequence[str] = (),
) -> list[str]:
    """Return the warnings that hold for a result."""
    # Where the law does not fit, the best delay compensates for what the law lacks.
    certain = delay is not None and delay.significant and model.fitted.misfit <= EQUATION.tolerated
    return [
        *campaign.warnings,
        *([_word_delay(delay, model, aligned)] if delay is not None and certain else []),
        *warn_of_negative_inertia(model),
        *_warn_of_signs(states, model),
        *_warn_of_softening(model),
        *_warn_of_evidence(campaign, states, model, indistinct),
    ]


def _warn_of_evidence(
    campaign: Campaign, states: Sequence[ForceStates], model: JointModel, indistinct: Sequence[str]
) -> Iterator[str]:
    """Yield what these runs cannot tell, and what the model leaves of them."""
    load, path = channel_words(model)
    least, fitted = min(states, key=lambda s: s.moving_fraction), model.fitted
    frequencies = {round(s.frequency, 3) for s in states if s.frequency is not None}
    one_run, one = len(states) == 1, len(frequencies) == 1
    undeclared = campaign.joint.inertia is None and one and states[0].method == "periodic"
    rest = "is not the model's (how much of it is noise could not be measured)"
    size = fitted.moment_rms or np.inf
    if np.isfinite(fitted.noise_floor):
        rest = f"is neither model nor noise (noise floor {100 * fitted.noise_floor / size:.1f} %)"
    explained = 100 * (1 - (fitted.residual_rms / size) ** 2)
    warnings = [
        (
            any(term in model for term in OFFSET_FAMILY),
            f"zero error of the {path}, quadratic stiffness and preload (or unequal Coulomb levels, or zero error of "
            f"the {load}) form one family: these data determine two numbers of it, not three; gain errors and "
            "gravity are never visible in such tests",
        ),
        (
            one_run and frequencies,
            "one periodic run only: on it stiffness terms look alike, and so do damping and friction; at least three "
            "levels at three frequencies distinguish them",
        ),
        (
            one_run and not frequencies,
            "one run only: its terms were checked on parts of it, and not at another frequency or level: record "
            "further runs",
        ),
        (
            one and not one_run,
            "one frequency only: whether the coefficients depend on it is open: record two others",
        ),
        (
            undeclared,
            in_words_of(
                campaign.joint.motion,
                "the inertia is not declared, and one frequency cannot separate it from stiffness: declare it",
            ),
        ),
        (
            indistinct,
            "left out, because on these runs they are combinations of other candidates (other levels or frequencies "
            f"tell them apart): {', '.join(indistinct)}",
        ),
        (
            # A free motion comes to rest; only what is driven can be driven harder.
            least.moving_fraction < SOUNDNESS.large_part and bool(np.ptp(least.moment)),
            f"run {least.run!r} moves in only {100 * least.moving_fraction:.0f} % of its samples, the others tell "
            "nothing: drive it harder",
        ),
        (
            model.terms and fitted.misfit > EQUATION.tolerated,
            f"the model explains {explained:.1f} % of the mean square {load}; {100 * fitted.misfit:.1f} % of the RMS "
            f"{load} {rest}: hysteresis, play or another effect outside this library is likely: diagnose the campaign",
        ),
    ]
    yield from (words for there, words in warnings if there)


def _word_delay(delay: ChannelDelay, model: JointModel, aligned: bool) -> str:
    load, path = channel_words(model)
    if delay.at_limit:
        return (
            f"the delay between {load} and {path} is not determined: the search ended at its limit of "
            f"{1e3 * abs(delay.time):.0f} ms; check the trigger of the recorder"
        )
    if aligned:
        return said_of_removed(delay, model.joint.motion)
    effect = ""
    if "linear_stiffness" in model:
        bias = -delay.time * model["linear_stiffness"].coefficient
        effect = f", which shifts the viscous damping by about {bias:.3g} {DAMPING[model.joint.motion]}"
    return (
        f"the {load} seems to {'lag' if delay.time > 0 else 'lead'} the {path} by {1e3 * abs(delay.time):.3f} ± "
        f"{1e3 * delay.standard_error:.3f} ms{effect}: check the common trigger, or run again with --align"
    )


def channel_words(model: JointModel) -> tuple[str, str]:
    """Return what the two channels are called for this joint's kind of motion."""
    q = quantities(model.joint.motion)
    return q.moment.lower(), q.angle.lower()


def _warn_of_signs(states: Sequence[ForceStates], model: JointModel) -> Iterator[str]:
    """Elastic stiffness and dissipation that are negative in every run point to a reversed channel."""
    stiffness, power = [], []
    # What completed a state that moves nowhere has no certain ends.
    for state in (each for each in states if each.moving.any()):
        moment = state.transfer_moment(model.inertia)[state.moving]
        angle, rate = state.angle[state.moving] - np.mean(state.angle), state.rate[state.moving]
        stiffness.append(float(np.mean((moment - moment.mean()) * angle)))
        power.append(float(np.mean(moment * rate)))
    # The secant: an elastic moment that is a small part of the whole may well fall, only a main part has a sign.
    top, load_and_path = model.fitted.angle, channel_words(model)
    rise = float(np.diff(model.moment(np.array([-top, top]), np.zeros(2)))[0]) if top > 0 else 0.0
    main = 0.5 * abs(rise) > SOUNDNESS.large_part * model.fitted.moment_rms
    backwards = main and rise < 0 and max(stiffness, default=0.0) < 0
    feeding = bool(model.terms) and max(power, default=0.0) < 0
    if backwards and feeding:
        yield (
            "stiffness and dissipation are both negative in every run: one channel seems reversed; give it a negative "
            "gain in [channels]"
        )
    elif backwards:
        yield in_words_of(
            model.joint.motion,
            "the elastic stiffness is negative in every run: check the signs of the channels, and the inertia",
        )
    elif feeding:
        yield (
            "the joint gives off energy in every run (negative dissipation): check the signs of the channels, and "
            f"whether the {load_and_path[0]} leads the {load_and_path[1]}"
        )
    else:
        yield from warn_of_negative_damping(model)


def warn_of_negative_damping(model: JointModel) -> Iterator[str]:
    """Warn of a viscous damping that feeds energy into a joint that dissipates on the whole."""
    if "linear_damping" not in model or model["linear_damping"].interval95[1] >= 0:
        return
    q = quantities(model.joint.motion)
    yield (
        f"the viscous damping is negative, {model['linear_damping'].coefficient:.3g} {DAMPING[model.joint.motion]}: "
        f"the {q.moment.lower()} falls as the {q.rate.lower()} grows, as friction does that is larger near standstill "
        "(Stribeck); keep to the tested range: beyond it the model gives off energy"
    )


def warn_of_negative_inertia(model: JointModel) -> Iterator[str]:
    """Warn of an identified inertia that no body has."""
    if INERTIA not in model or model[INERTIA].coefficient >= 0:
        return
    q = quantities(model.joint.motion)
    yield (
        f"the identified {q.inertia.lower()} is negative, {model[INERTIA].coefficient:.3g} {q.inertia_unit}, which is "
        "impossible: runs in different units, a time delay, a wrong sampling rate or a law that lacks a term; declare "
        f"the {q.inertia.lower()} if it is known"
    )


def _warn_of_softening(model: JointModel) -> Iterator[str]:
    """Warn where the elastic moment reaches zero tangent inside the tested range."""
    top = model.fitted.angle
    if not any(term.family == "stiffness" for term in model.terms) or top <= 0:
        return
    angle = np.linspace(-top, top, 401)
    tangent = np.gradient(model.moment(angle, np.zeros_like(angle)), angle)
    beyond = np.abs(angle[tangent <= 0])
    if tangent[200] > 0 and beyond.size:
        unit, moment = quantities(model.joint.motion).angle_unit, channel_words(model)[0]
        yield (
            f"the elastic {moment} softens to zero tangent at {beyond.min():.3g} {unit}, inside the tested range of "
            f"{top:.3g} {unit}: a {moment}-driven joint snaps through there; stay below it"
        )


def identifiability_notes(campaign: Campaign, states: Sequence[ForceStates]) -> list[str]:
    """Return one line for each question that a campaign's runs leave open.

    Parameters
    ----------
    campaign : Campaign
    states : sequence of ForceStates
        Of the runs that may be used for identification, whole.
    """
    held = (
        "the runs kept for validation are all there is to check it"
        if campaign.validation_runs
        else "the gaps are those of its parts, left out in turn; record a second run to check the model"
    )
    frequencies = [s.frequency for s in states if s.frequency is not None]
    alike = len(frequencies) == len(states) and max(frequencies) < (1 + SOUNDNESS.small_share) * min(
        frequencies
    )
    ranges = [float(np.ptp(s.angle)) for s in states]
    periodic = [s for s in states if s.method == "periodic"]
    one_level = len(periodic) == len(states) and max(ranges) < (1 + SOUNDNESS.alike) * min(ranges)
    once = [s.run for s in states if s.noise.source in ("spectrum", "coherent")]
    single = "no run repeats" if len(once) == len(states) else f"nothing repeats in {list_some(once)}"
    short = [
        s.run
        for s in periodic
        if s.frequency and s.n_samples * s.frequency < SOUNDNESS.few_periods * s.sample_rate
    ]
    ends = {run.name: run.duration for run in campaign.runs}
    dropped = {s.run: s.dropped / ends[s.run] for s in periodic}
    late = [run for run, share in dropped.items() if share > SOUNDNESS.large_part]
    notes = [
        (len(states) == 1, f"one run only: {held}"),
        (
            alike,
            in_words_of(
                campaign.joint.motion,
                "one frequency only: effects of frequency, rate and inertia cannot be distinguished; record another",
            ),
        ),
        (one_level, "one level only: effects of amplitude cannot be distinguished; record another"),
        (
            campaign.quasi_static,
            "the noise was estimated from neighbouring samples of the path, not from repetition; go through a cycle "
            "twice to measure it",
        ),
        (
            once and not campaign.quasi_static,
            f"{single}: the noise is estimated from the end of the spectrum, any signal there included; record one run "
            "twice to measure it",
        ),
        (
            short,
            f"fewer than {SOUNDNESS.few_periods} periods in {list_some(short)}: what changes in time cannot be seen; "
            "record longer",
        ),
        (
            late,
            f"{100 * max(dropped.values(), default=0.0):.0f} % of the record was left out as start-up in "
            f"{list_some(late)}: what changed in that time was not examined; let the motion settle before recording",
        ),
    ]
    return [*campaign.warnings, *(words for there, words in notes if there)]
