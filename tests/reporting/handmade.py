"""A report's data made by hand, only from formulas: what pages and figures show does not hang on any algorithm."""

from itertools import cycle

import numpy as np

from sindyjoint import JointModel
from sindyjoint.equation import Fitted, ModelTerm
from sindyjoint.record import Joint
from sindyjoint.reporting import GroupFit, Loop, PathStep, Provenance, ReportData, model_sheets, view_of
from sindyjoint.states.surface import force_state_map
from sindyjoint.trust import Light, Trust

HOSTILE = "<script>document.title='taken'</script>\"'&amp; $x^2_$ {{ 7*7 }} [bold]关节 --><img src=x onerror=alert(1)>"

# id, symbol, name, family, formula, unit (rotation), unit (translation), coefficient, standard error, share
TERMS = [
    (
        "linear_stiffness",
        "k1",
        "linear stiffness",
        "stiffness",
        "theta",
        "N*m/rad",
        "N/m",
        5912.0,
        41.7,
        0.31,
    ),
    (
        "cubic_stiffness",
        "k3",
        "cubic stiffness",
        "stiffness",
        "theta**3",
        "N*m/rad^3",
        "N/m^3",
        -2.684e9,
        1.2e7,
        0.05,
    ),
    ("linear_damping", "c1", "viscous damping", "damping", "omega", "N*m*s/rad", "N*s/m", 48.13, 0.09, 0.1),
    ("coulomb_friction", "M_F", "Coulomb friction", "friction", "sign(omega)", "N*m", "N", 1.867, 0.006, 0.2),
]


def trust(motion="rotation", found=True):
    load = "moment" if motion == "rotation" else "force"
    data = Light("data", "good", "sound: nothing found that shifts a coefficient")
    tested = Light("determined", "fair", "2 frequencies, 2 levels in 2 runs; 3 of each tell the terms apart")
    if not found:
        none = Light("explained", "poor", "no set of terms predicts the moment")
        step = ("sindyjoint compare CAMPAIGN", "see whether another method or library finds a model")
        return Trust((data, none, Light("predicts", "poor", "there is no model"), tested), (step,))
    gap = f"gap 1.03 % of the RMS {load} (0.98 % to 1.08 %), noise floor 1 % from the periods of each run"
    error = "error 0.938 % on groups of runs left out of the fit, 0.91 times the residual"
    step = (
        "record runs at 1 more frequency and 1 more level",
        "tell terms apart that are alike on these runs",
    )
    return Trust((data, Light("explained", "good", gap), Light("predicts", "good", error), tested), (step,))


def model(motion="rotation", name="bench joint", terms=TERMS):
    made = tuple(
        ModelTerm(id_, symbol, title, family, formula, (), unit if motion == "rotation" else force_unit, value, error,
                  (value - 1.96 * error, value + 1.96 * error), share)
        for id_, symbol, title, family, formula, unit, force_unit, value, error, share in terms
    )  # fmt: skip
    errors = np.array([term.standard_error for term in made])
    covariance = np.outer(errors, errors) * (0.4 + 0.6 * np.eye(errors.size))
    fitted = Fitted(3.5, 0.036, 0.035, 0.6, 4321, 2, 8e-4, 0.04, (3.0, 6.0))
    joint = Joint(name, motion, 0.02)
    return JointModel(joint, made, tuple(map(tuple, covariance.tolist())), fitted)


def report_data(
    motion="rotation", name="bench joint", terms=TERMS, runs=("a", "b"), periodic=True, frequencies=(3.0, 6.0)
):
    law = model(motion, name, terms)
    loops = [
        _loop(law, run, f, level, periodic)
        for run, f, level in zip(runs, frequencies, cycle(("low", "high")), strict=False)
    ]
    angle, rate, moment, residual = (
        np.concatenate(part) for part in zip(*(one[1] for one in loops), strict=True)
    )
    surface = force_state_map(angle, rate, moment, 12)
    upper, lower = model_sheets(law, surface)
    path = [
        PathStep(
            tuple(t[0] for t in terms[: k + 1]), 0.3 / (k + 1) ** 3, 2.0 / 4**k, 2.1 / 4**k, 900.0 / (k + 1)
        )
        for k in reversed(range(len(terms)))
    ]
    groups = [f"{f:.4g} Hz" for f in frequencies] if periodic else ["part 1", "part 2"]
    return ReportData(
        model=law,
        verdict="refuted",
        verdict_reason="quadratic stiffness would carry less than 1 % of the moment",
        selection_reason="the largest set in which each term carries at least 0.002 of the moment alone",
        warnings=("one level only", f"run {runs[0]!r} moves in only 19 % of its samples"),
        loops=tuple(one[0] for one in loops),
        surface=surface,
        residual_map=force_state_map(angle, rate, residual, 12),
        upper=upper,
        lower=lower,
        path=tuple(path),
        chosen=0 if path else None,
        candidates=tuple(t[0] for t in TERMS) + ("quadratic_stiffness",),
        groups=tuple(
            GroupFit(g, law.coefficients * (1 + 0.01 * i), law.standard_errors) for i, g in enumerate(groups)
        ) if terms else (),
        trust=trust(motion),
    )  # fmt: skip


def _loop(law, run, frequency, level, periodic):
    phase = np.linspace(0, 2 * np.pi, 400)
    size = 8e-4 if level == "high" else 5e-4
    angle, rate = size * np.cos(phase), -size * 2 * np.pi * frequency * np.sin(phase)
    # What the model lacks, made up: 20 mN·m over the phase.
    residual = 0.02 * np.cos(3 * phase)
    modelled = law.moment(angle, rate)
    moving = np.abs(rate) > 0.1 * np.abs(rate).max()
    loop = Loop(
        run=run,
        frequency=frequency if periodic else None,
        level=level,
        method="periodic" if periodic else "broadband",
        samples=4000,
        moving_fraction=float(moving.mean()),
        moment_noise=0.035,
        residual_rms=0.036,
        angle=angle,
        moment=modelled + residual,
        model=modelled,
        moving=moving,
        time=np.linspace(0.1, 9.9, 40),
        residual_over_time=0.036 + 0.002 * np.sin(np.arange(40)),
        residual_over_phase=0.02 * np.cos(np.linspace(0, 6 * np.pi, 60)) if periodic else np.empty(0),
    )
    return loop, tuple(part[moving] for part in (angle, rate, modelled + residual, residual))


ORIGIN = Provenance(
    command_line="sindyjoint discover 'my tests' --out results",
    seed="7",
    made="2031-02-03 04:05:06 UTC",
    versions=(("Python", "3.11.0"), ("sindyjoint", "9.9.9")),
    inputs=(("a", "a.csv", "ab" * 32), ("b", "b.csv", "cd" * 32)),
    notes=("b.csv: resampled to 1000 Hz",),
)


def page_html(result, origin, pictures):
    """Return the page of a result as HTML."""
    view = view_of(result)
    return view.html(result, view.gather(result), origin, pictures)
