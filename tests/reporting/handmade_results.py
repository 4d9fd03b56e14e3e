"""A verification, diagnoses and a comparison made by hand."""

from dataclasses import replace

import numpy as np
from handmade import model

from sindyjoint.diagnosis import Advice, Budget, Gap, Step
from sindyjoint.diagnosis.parts import Place
from sindyjoint.diagnosis.result import AdviceSearch, Diagnosis, RecordGap, RunGap
from sindyjoint.discovery.frequency import frequency_test
from sindyjoint.judgement.comparison import Choice, ChosenTerm, Comparison
from sindyjoint.response import Band, Oscillation, RunVerification, Verification


def verification(name="bench joint", runs=("pulse at tip",), subject="a rig", failed=False):
    return Verification(
        model=model(name=name),
        kind="rig",
        subject=subject,
        verdict="failed" if failed else "passed",
        reason="the response is simulated within 2 %",
        tolerance=0.05,
        response_nrmse=0.02,
        moment_nrmse=None,
        noise_floor=0.01,
        amplitude_rms_error=0.003,
        mean_period_difference=0.0004,
        runs=tuple(_decay(run, failed) for run in runs),
        warnings=("the response is simulated, not measured",),
    )


def _decay(name, failed):
    time = np.linspace(0, 5, 2501)
    measured = 1e-3 * np.exp(-0.4 * time) * np.cos(2 * np.pi * 2 * time)
    simulated = 1.01 * measured
    turns = np.arange(0, 5.0, 0.25)
    oscillation = Oscillation(turns, 1e-3 * np.exp(-0.4 * turns) * (-1.0) ** np.arange(turns.size), 1)
    return RunVerification(
        name=name,
        channel="displacement",
        drive="pulse",
        time=time,
        measured=measured,
        simulated=None if failed else simulated,
        band=None if failed else Band(0.9 * simulated, 1.1 * simulated, 20, 0),
        response_nrmse=None if failed else 0.02,
        moment_nrmse=None,
        noise_floor=0.01,
        amplitude_rms_error=None if failed else 0.003,
        mean_period_difference=None if failed else 0.0004,
        oscillations=(oscillation, None if failed else oscillation),
        energy=None
        if failed
        else np.array([np.exp(-0.4 * np.arange(9)), 1.02 * np.exp(-0.4 * np.arange(9))]),
        failure="the angle passed the softening limit at 0.2 s" if failed else "",
        rmse=None if failed else 2.4e-5,
        rmse_unit="m",
    )


def run_gaps(residual):
    """Return a run that repeats and one that does not, of which a model leaves a cubic moment of this size, N·m."""
    runs = []
    for name, level, repeats in (("4Hz $high", "high", True), ("burst", None, False)):
        time = np.arange(0, 0.25, 0.25 / 120)
        angle, rate = 1e-3 * np.sin(8 * np.pi * time), 8e-3 * np.pi * np.cos(8 * np.pi * time)
        model = 5912 * angle + 48 * rate
        measured = model + residual * (angle / 1e-3) ** 3 + 0.01 * np.sin(977 * time)
        runs.append(
            RunGap(
                name,
                level,
                4.0 if repeats else 0.0,
                repeats,
                time,
                angle,
                rate,
                measured,
                model,
                0.01,
                time.size,
            )
        )
    return tuple(runs)


def diagnosis(name="bench joint", effect="jenkins_element", verdict="ambiguous"):
    gaps = Gap(0.0216, 0.0262), Gap(0.0104, 0.0101)
    step = Step(effect, "memory", (effect, "bouc_wen"), 0.88, (("bouc_wen", 0.1), ("play", 0.01)),
                {"k_t": 3115.0, "theta_y": 7.5e-5}, ("linear_damping",), *gaps,
                {"k_t": "N*m/rad", "theta_y": "rad"})  # fmt: skip
    named = verdict in ("named", "ambiguous")
    return Diagnosis(
        verdict=verdict,
        reason="these runs cannot tell apart: Jenkins element or Bouc–Wen",
        initial=gaps[0],
        final=gaps[1] if named else gaps[0],
        noise_floor=Gap(0.00985, float("nan")),
        budget=Budget(0.63, 0.01, 0.15, 0.0, 0.21),
        where=(
            Place("phase", "after the reversals, on the way back to zero", 0.85,
                  "after the reversals, on the way back to zero: 85 % of the gap in 42 % of the samples"),
            Place("angle", (0.25, 0.5), 0.6,
                  "|angle| from 25 % to 50 % of the largest: 60 % of the gap in 33 % of the samples"),
        ) if named else (),
        steps=(step,) if named else (),
        advice=(Advice((effect, "bouc_wen"), 17.4, 1.16e-4, "sinusoidal angle", 0.99),) if named else (),
        warnings=("the campaign is simulated (a virtual test), not measured",),
        model=model(name=name),
        hidden=effect if named else None,
        before=run_gaps(0.05),
        after=run_gaps(0.0) if named else (),
        search=AdviceSearch("complete", 120, 120),
    )  # fmt: skip


def structure(name="bench joint", rig="a rig", point="tip"):
    """Return a diagnosis of a structure: that of the joint, and a record with its simulations."""
    joint = diagnosis(name)
    time = np.linspace(0, 10, 4001)
    measured = 1e-3 * np.exp(-0.4 * time) * np.cos(2 * np.pi * 4 * time)
    before = 1e-3 * np.exp(-0.3 * time) * np.cos(2 * np.pi * 4.03 * time)
    record = RecordGap(point, time, measured, before, 1.01 * measured, 1e-5, 5.0, 2.71, 0.0264, 0.0267)
    return replace(joint, source="structure", rig=rig, records=(record,))


def comparison(name="bench joint", method="stlsq"):
    found = (
        "linear_stiffness",
        "quadratic_stiffness",
        "cubic_stiffness",
        "linear_damping",
        "coulomb_friction",
    )
    values = (5912.0, -1.9e5, -2.684e9, 48.13, 1.867)

    def choice(title, ids=found, **scores):
        terms = tuple(
            ChosenTerm(i, v, abs(v) / 100, (v - 0.02 * abs(v), v + 0.02 * abs(v)))
            for i, v in zip(found, values, strict=True)
            if i in ids
        )
        extra = tuple(ChosenTerm(i, 1.0, 0.1, (0.8, 1.2)) for i in ids if i not in found)
        return Choice(title, terms + extra, "by hand", 20, **scores)

    units = dict(zip(found, ("N*m/rad", "N*m/rad^2", "N*m/rad^3", "N*m*s/rad", "N*m"), strict=True))
    frequencies = (3.0, 4.0, 6.0)
    return Comparison(
        joint=name,
        motion="rotation",
        simulated=True,
        ids=(*found, "quintic_stiffness", "dead_zone"),
        units={**units, "quintic_stiffness": "N*m/rad^5"},
        methods=(choice(method, residual=0.01, held_out=0.0101, response=0.01, seconds=0.2),
                 choice("lasso_lars", (*found[:2], *found[3:], "quintic_stiffness"), held_out=0.02, seconds=1.0)),
        frequencies=tuple(choice(f"{f:g} Hz") for f in frequencies),
        libraries=(choice("paper"), choice("extended")),
        inclusion=(1.0, 0.97, 1.0, 1.0, 1.0, 0.03, 0.0),
        sets=((found, 0.97),),
        left_out={},
        tests=tuple(
            frequency_test(i, frequencies, np.array([0.99, 1.0, 1.015]) * v, np.full(3, abs(v) / 200), np.full(3, 12.0))
            for i, v in zip(found, values, strict=True)
        ),
        model=choice("stlsq, corrected"),
        undetermined=("quadratic stiffness and preload are one answer",),
        warnings=("the campaign is simulated (a virtual test), not measured",),
        seconds={"methods": 3.0},
        discovery=None,
        noise_floor=0.0097,
    )  # fmt: skip
