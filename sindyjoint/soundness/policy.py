"""Limits of what a campaign can show."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit

CALIBRATED = "calibrated on ten random joints with injected faults and their sound campaigns"


@dataclass(frozen=True)
class SoundnessPolicy:
    """Limits that decide what is warned of; the meaning of each is in its metadata."""

    same_level: float = limit(1.15, "ratio of the ranges of angle below which all runs have one level")
    same_frequency: float = limit(1.02, "ratio of frequencies below which all runs have one")
    large_drop: float = limit(0.25, "share of a record left out as start-up from which it is reported")
    few_periods: int = limit(8, "periods below which a change in time cannot be seen", unit="periods")
    elastic_share: float = limit(
        0.2,
        "share of the moment's RMS from which the elastic moment has a definite sign",
        source="a small part of the whole may well fall",
    )
    censored_sigmas: float = limit(
        2.0,
        "noise levels from the limit of a saturated channel within which its running mean must not come for a sample "
        "to be used",
        source="noise outwards is cut off there, of 1 in 40 samples at two levels; three cost a quarter more",
    )
    hardly_moving: float = limit(0.2, "share of its samples in which a run must move not to be warned of")
    fewest_periods: int = limit(
        3, "periods from which a run has a course that can be followed", unit="periods"
    )
    same_amplitude: float = limit(
        0.1,
        "change of amplitude up to which a run without a declared frequency counts as steady",
    )
    main_line: float = limit(
        0.8, "share of the angle's RMS that one line carries in a run taken for a sinusoid"
    )
    noise_changes: float = limit(
        0.55,
        "share of sign changes of third differences from which they are noise",
        source="white noise has 0.77",
    )
    saturated_arrival: float = limit(
        5.5,
        "ratio of the distances from its limit 9 and 3 samples away up to which a channel arrives with a slope",
        source="3 for a straight line, 9 for a standstill that is reached smoothly",
    )
    plateau: float = limit(
        0.3,
        "share of a noise-free channel at one extreme that is a plateau of the law",
        source="Coulomb friction",
    )
    resolved_noise: float = limit(
        3.0, "noise in steps of the resolution above which equal neighbours are no chance", source=CALIBRATED
    )
    saturated_samples: int = limit(
        6,
        "samples at one extreme value from which a channel may be saturated",
        unit="samples",
    )
    saturated_crowd: float = limit(
        4.0,
        "how much more often than the next three values the extreme one occurs in a saturated channel",
        source="the crest of a sinusoid in steps of the resolution reaches 2.4",
    )
    saturated_share: float = limit(0.001, "share of saturated samples that is reported")
    bearable_saturation: float = limit(
        0.01, "share of saturated samples of the angle up to which work goes on"
    )
    most_masked: float = limit(0.2, "share of a run that may be left out")
    spike_noise: float = limit(12.0, "spike in RMS of the channel's noise", source=CALIBRATED)
    spike_usual: float = limit(
        4.0, "spike over what 99 % of the samples differ from their neighbours by", source=CALIBRATED
    )
    spike_step: float = limit(8.0, "spike in steps of the channel's resolution")
    spike_least: float = limit(0.3, "spike in amplitudes of the channel", source=CALIBRATED)
    spike_acceleration: float = limit(
        2.0, "the same of an acceleration, which jumps within its range where friction does"
    )
    fewest_jumps: int = limit(3, "jumps in a campaign from which a joint may be what jumps")
    jump_range: float = limit(
        1.5, "range of the other samples within which a joint's jumps end", source="set on seeds 971 and 1921"
    )
    jump_share: float = limit(
        0.8, "share of jumps while the channel goes one way, in or out", source="half of them do by chance"
    )
    jump_values: float = limit(0.05, "range of the ends of jumps, in amplitudes, that dropouts do not have")
    rare_kinks: float = limit(
        0.01,
        "share of samples at which the rate changes most; a spike of the moment there belongs to the motion",
    )
    jerk_size: float = limit(10.0, "amplitudes of the moment that a stop of the motion may reach")
    sensors_gain: float = limit(
        0.03, "relative difference of the motions that two sensors show, beyond which they disagree"
    )
    sensors_unit: float = limit(
        0.3, "the same beyond which unit or gain of one of them is wrong, and no model is made"
    )
    sensors_delay: float = limit(
        0.01,
        "phase by which a sensor of the motion may lag another at the main frequency",
        unit="rad",
        source="1 % of the elastic moment looks like damping",
    )
    sensors_sigmas: float = limit(4.0, "standard errors that either must exceed, too")
    most_spikes: float = limit(
        0.01, "share of samples above which what looks like spikes belongs to the joint"
    )
    held_chance: float = limit(1e-4, "expected number of held values by chance below which one is reported")
    fewest_dead: int = limit(
        2, "periods without excitation at an end of a run that are reported", unit="periods"
    )
    held_jump: float = limit(
        5.0,
        "jump on leaving a held value, over the moves that 98 % of the samples make at most",
        source=CALIBRATED,
    )
    held_samples: int = limit(
        4, "equal samples from which a value counts as held where the noise is not resolved"
    )
    dropout_samples: int = limit(
        30,
        "equal samples above which a dropout is called a frozen segment",
        unit="samples",
        source="convention",
    )
    copied_samples: int = limit(16, "equal samples in a row that are a copy and no chance", unit="samples")
    repeats_itself: float = limit(
        0.5, "share of repeated blocks above which a run is periodic to the last digit"
    )
    copied_share: float = limit(0.05, "share of a run found in another one that is reported")
    copied_noise: float = limit(0.98, "correlation of the noise of two runs from which one is a scaled copy")
    copied_period: float = limit(
        32.0,
        "samples per period below which friction steps, which two levels share, are too dense to stand out of noise",
        source="a step reaches four third differences, and comes twice a period",
    )
    dead_share: float = limit(0.05, "amplitude over the run's median below which a period has no excitation")
    phase_scatter: float = limit(
        0.004,
        "scatter of the phase from period to period that is taken for granted",
        unit="rad",
        source=CALIBRATED,
    )
    phase_step: float = limit(0.06, "jump of the phase that is reported", unit="rad", source=CALIBRATED)
    bridged_gap: float = limit(
        0.1, "gap in periods of its main line that is bridged in a run that does not repeat"
    )
    lost_samples: float = limit(1.0, "lost samples that are reported", unit="samples")
    step_contrast: float = limit(
        2.5, "step over the ranges of the four periods on either side of it", source=CALIBRATED
    )
    level_scatter: float = limit(
        0.002, "relative scatter of the amplitude that is taken for granted", source=CALIBRATED
    )
    level_step: float = limit(0.04, "relative step of the amplitude that is reported", source=CALIBRATED)
    gain_alone: float = limit(0.15, "change of the other channel up to which a step is one of the gain")
    zero_scatter: float = limit(
        0.002, "scatter of the zero, in amplitudes, that is taken for granted", source=CALIBRATED
    )
    zero_step: float = limit(0.04, "step of the zero, in amplitudes, that is reported", source=CALIBRATED)
    drift: float = limit(
        0.05, "drift of the zero over the run, in amplitudes, that is reported", source=CALIBRATED
    )
    drift_contrast: float = limit(
        6.0, "drift over the run in standard deviations about its straight line", source=CALIBRATED
    )
    even_drift: float = limit(
        0.4,
        "least ratio of the slopes of both halves of a drift, which a start-up does not keep",
        source=CALIBRATED,
    )
    drift_left: float = limit(
        0.15, "RMS that the law and a drift may leave of a run that does not repeat, in parts of the moment's"
    )
    clock_drift: float = limit(
        0.03, "drift of the phase between the channels that is reported", unit="rad", source=CALIBRATED
    )
    wrong_frequency: float = limit(
        0.004, "relative error of the declared frequency that is reported", source=CALIBRATED
    )
    moving_rate: float = limit(
        0.1, "share of the largest rate above which runs are compared", source="reversals hold friction steps"
    )
    ridge: float = limit(1e-9, "ridge of the flexible law that runs share", source="rounding")
    fewest_compared: int = limit(3, "runs from which one can be held against the others", unit="runs")
    common_misfit: float = limit(
        0.06,
        "RMS that the law of the other runs may leave of them, in parts of the moment's",
        source=CALIBRATED,
    )
    common_gain: float = limit(
        0.6, "what the misfit of the others falls to, at most, without an odd run", source=CALIBRATED
    )
    run_departure: float = limit(
        0.04, "RMS by which a run departs from the law of the others", source=CALIBRATED
    )
    run_contrast: float = limit(
        3.0, "departure of an odd run over the misfit of the others", source=CALIBRATED
    )
    kin_departs: float = limit(
        0.5,
        "departure of all other runs of its frequency, in parts of a run's, from which the law depends on frequency",
        source="a fault of one run leaves the others where they are",
    )
    compared_rows: float = limit(
        0.2, "share of a run's rows that the others must cover to be held against it"
    )
    another_scale: float = limit(
        10.0,
        "ratio of a run's amplitude to the usual one, either way, from which it is no edge of a common range",
    )
    stray_rows: float = limit(
        0.05, "share of a run's rows, those furthest from the law, that alone make no departure"
    )
    gain_explains: float = limit(
        0.4, "what a factor must leave of the departure, at most, to explain it", source=CALIBRATED
    )
    filter_least: float = limit(
        0.004, "RMS left by the flexible law below which no filter is looked for", source=CALIBRATED
    )
    filter_gain: float = limit(
        0.6, "what undoing a filter must lower the misfit to, at most", source=CALIBRATED
    )
    filter_left: float = limit(0.04, "misfit that may remain with a filter undone", source=CALIBRATED)
    filter_contrast: float = limit(
        10.0,
        "time constant of a low-pass on the moment in standard errors by its scatter over frequencies and levels",
        source="friction that builds up with time lags likewise, but not by one time",
    )
    filter_over_delay: float = limit(
        0.9, "misfit with a filter undone over that with a delay removed, at most", source=CALIBRATED
    )
    delay_rates: tuple[float, ...] = limit(
        (0.35, 0.2), "shares of the largest rate above which rows tell a delay", source=CALIBRATED
    )
    nearest_rate: float = limit(
        0.04, "the same where the joint never sticks, and below which it does", source=CALIBRATED
    )
    delay_gain: float = limit(
        0.35,
        "what a delay must win of the residual's mean square, in parts of what it leaves",
        source=CALIBRATED,
    )
    delay_left: float = limit(
        0.015,
        "misfit of the paper's law, its delay removed, up to which a delay is believed",
        source=CALIBRATED,
    )
    least_delay: float = limit(3e-4, "delay that is reported", unit="s", source=CALIBRATED)
    delay_agreement: float = limit(
        0.3, "relative difference of a delay from rows of faster and of slower motion", source=CALIBRATED
    )
    delay_levels: int = limit(
        3, "groups of levels over which the scatter of a delay is looked at", source="time"
    )
    delay_contrast: float = limit(
        4.0, "delay in standard errors by its scatter over frequencies and levels", source="convention"
    )
    rival_gain: float = limit(
        0.95, "share of a delay's gain that no single other term may have", source=CALIBRATED
    )
    delay_samples: int = limit(
        40_000, "samples of runs that do not repeat that a delay is sought in", unit="samples", source="time"
    )
    longest_broadband: float = limit(5e-3, "delay of runs that do not repeat that is believed", unit="s")
    most_broadband: int = limit(24, "runs that do not repeat that are held against each other", source="time")
    broadband_gain: float = limit(
        0.2, "what a delay must win where runs do not repeat, in parts of what it leaves", source=CALIBRATED
    )
    broadband_left: float = limit(
        0.04,
        "misfit, the delay removed, up to which it is believed where runs do not repeat",
        source=CALIBRATED,
    )
    broadband_memory: float = limit(
        0.9,
        "misfit of a law with memory, or of other damping, in parts of that with the delay removed, below which it is "
        "no delay",
        source=CALIBRATED,
    )
    large_lead: float = limit(15.0, "lead of an AC-coupled channel that stops", unit="deg")
    visible_step: float = limit(0.01, "resolution in standard deviations of a channel that is reported")
    coarse_step: float = limit(0.1, "resolution in standard deviations that biases", source=CALIBRATED)
    excess_noise: float = limit(4.0, "noise of a run over that of the others")
    noticeable_noise: float = limit(0.03, "excess noise in parts of the channel that biases")
    line_contrast: float = limit(7.0, "mains line over the spectrum about it", source=CALIBRATED)
    visible_line: float = limit(0.003, "mains line in parts of the channel's RMS")
    strong_line: float = limit(0.02, "mains line in parts of the channel's RMS that biases")
    largest_angle: float = limit(
        3.4,
        "angle beyond which a joint's motion is implausible",
        unit="rad",
        source="half a turn and a margin",
    )
    largest_stroke: float = limit(10.0, "stroke beyond which a displacement is implausible", unit="m")
    smallest_motion: float = limit(
        1e-9,
        "amplitude below which no joint moves",
        unit="rad or m",
        source="below any sensor of vibration tests",
    )
    absurd_turns: float = limit(10.0, "how far beyond the largest plausible size no model is made")
    inertia_above: float = limit(
        1.0, "moment of the inertia over the measured one that is reported", source="balance of moments"
    )
    inertia_absurd: float = limit(3.0, "moment of the inertia over the measured one that stops")
    inertia_denied: float = limit(
        0.6, "misfit with a free inertia over that with the declared one that denies it", source=CALIBRATED
    )
    far_offset: float = limit(0.5, "middle of the motion in amplitudes from which the zero is far from it")
    odd_offset: float = limit(0.25, "middle of a run's motion in amplitudes from that of the others")
    given_off: float = limit(
        0.03,
        "energy given off, in parts of the RMS of moment times rate, that is reported",
        source=CALIBRATED,
    )
    mostly_given_off: float = limit(0.5, "energy given off from which the sign alone can be at fault")
    few_samples: float = limit(16.0, "samples per period below which processing shows in coefficients")
    same_unit: float = limit(
        1e-3, "relative difference up to which two units are the same", source="spellings of one unit"
    )
    only_noise: float = limit(
        0.9,
        "noise from sample to sample of a drive, in parts of its standard deviation, beyond which nothing drives",
    )
    fine_step: float = limit(
        1e-3,
        "resolution of a structure's channel in standard deviations below which equal neighbours are no chance",
    )
    scattered: float = limit(
        0.2,
        "change of a channel's main line from period to period, in parts of it, from which it has no course",
    )
    usual_uncertainty: float = limit(
        0.02,
        "relative standard uncertainty of every stiffness and mass of a structure that is assumed where less is stated",
        source="beams and masses are hardly known better; what it explains is no fault of a sensor",
    )
    agreement: float = limit(
        1.5,
        "mean square by which channels of a structure disagree, in their noise, from which a faulty one is sought",
    )
    explained_by_one: float = limit(
        0.4, "what undoing a fault of one channel leaves of that mean square, at most, to be believed"
    )
    clearly_better: float = limit(
        1.5,
        "mean square that a fault of any other channel leaves, over that of the best, for the best to be named",
    )
    as_good: float = limit(
        1.1, "the same up to which a simpler fault (no delay, all runs) is taken for the best of its channel"
    )
    odd_run: float = limit(
        1.2, "disagreement of a run over the median of all runs from which it may have a fault of its own"
    )
    longest_turn: float = limit(
        0.2, "longest delay of a channel that is sought, in periods of the fastest main line", unit="periods"
    )
    shows_nothing: float = limit(
        0.05, "share of what the others predict below which a sensor of a structure shows nothing"
    )
    shift_biases: float = limit(
        0.01, "shift of a recovered angle or moment, relative, beyond which a faulty channel biases"
    )
    shift_stops: float = limit(0.3, "the same beyond which no model is made")
    line_share: float = limit(
        0.3,
        "share of the strongest line that the declared frequency has at least",
        source="a square wave's third",
    )


POLICY = SoundnessPolicy()
