"""Limits of the measurement of bias: when a synthetic replicate stands for its run, and what of it is corrected."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class BiasPolicy:
    """Limits that decide what is taken out of the coefficients; the meaning of each is in its metadata."""

    uncertain_share: float = limit(
        0.25,
        "share of a measured bias that stays in the standard error: it was measured with the model's coefficients, "
        "not the joint's",
    )
    uncertain_share_cut: float = limit(
        0.5,
        "the same where sampling cuts the motion: bias is then large, and depends on what the simulation lacks",
        source="calibrated on campaigns of 10 to 12 samples per period",
    )
    cut_error: float = limit(
        0.0007,
        "share of the moment's RMS by which a simulation errs where sampling cuts the motion",
        source="calibrated on campaigns of 10 to 12 samples per period",
    )
    cut_period: float = limit(
        12.0,
        "samples per period up to which it does; of more it errs by as much less, for a step of friction then takes as "
        "much less of the period",
        source="the calibration above",
    )
    largest_difference: float = limit(
        0.15,
        "RMS difference of smoothed angles, relative to the angle's, up to which a replicate of a run that does not "
        "repeat stands for it",
    )
    drive_band: float = limit(0.8, "share of the angle's band below which the band of the drive must end")
    inertia_band: float = limit(0.5, "share of the angle's band above which an exciter inertia is looked for")
    main_line: float = limit(0.01, "density of a main line of the angle, as a share of the largest")
    beyond_lines: float = limit(
        1.5, "multiple of the highest main line beyond which an exciter inertia is looked for"
    )
    inertia_correlation: float = limit(
        0.5, "least correlation of acceleration and moment with which an exciter inertia is seen"
    )
    inertia_significance: float = limit(
        3.0,
        "the same in standard errors of a correlation of as many harmonics",
        source="two or three harmonics agree by chance",
    )
    likeness: float = limit(
        2.0,
        "weighted squared difference of the harmonics beyond the first, in what errors and model allow, up to which a "
        "replicate of a periodic run stands for it",
    )
    harmonic_model_error: float = limit(
        0.06,
        "squared relative difference that the model is allowed in these harmonics",
        source="a quarter, squared",
    )
    fundamental_difference: float = limit(
        0.2, "relative difference of the first harmonic up to which it does"
    )
    completion_matters: float = limit(
        0.01,
        "share of the moment's RMS that the inertia's moment of weak harmonics must have before they are exchanged "
        "for the model's",
    )
    harmonic_as_measured: float = limit(
        10.0, "standard errors from which a harmonic is the measured one", source="known to a tenth"
    )


POLICY = BiasPolicy()
