"""The catalogue of effects: read, refused in one line, and right along a motion that has a closed form."""

import shutil

import numpy as np
import pytest

from sindyjoint.diagnosis import MeasuredMotion, load_effects, read_effects, select_effects
from sindyjoint.equation import Reference
from sindyjoint.errors import FormulaError, InputError, MissingInputError, UnitError, UnknownNameError
from tests.conftest import LIBRARIES

WANTED = """quintic_stiffness bilinear_stiffness dead_zone constant_moment direction_dependent_damping quadratic_damping
cubic_damping amplitude_dependent_damping position_dependent_friction stribeck_friction dahl_friction
bouc_wen_hysteresis jenkins_element lugre_friction backlash_play maxwell_branch fractional_damping inertia_error
channel_delay angle_offset moment_drift angle_drift stiffness_drift frequency_dependent_stiffness""".split()
AMPLITUDE, FREQUENCY, N = 1e-3, 4.0, 720


def sinusoid():
    phase = 2 * np.pi * np.arange(N) / N
    w = 2 * np.pi * FREQUENCY
    zero = np.zeros(N)
    return MeasuredMotion(
        AMPLITUDE * np.sin(phase),
        AMPLITUDE * w * np.cos(phase),
        -AMPLITUDE * w**2 * np.sin(phase),
        1 / (N * FREQUENCY),
        phase / w,
        FREQUENCY,
        zero,
        zero,
        np.arange(N),
        True,
    )


def effect(name):
    return select_effects(load_effects(), [name])[0]


def work(column, motion):
    """Energy per cycle ∮ column dθ, by the periodic trapezium rule."""
    return float(np.sum(column * motion.rate) * motion.step)


def test_every_effect_of_the_list_ships():
    assert set(WANTED) <= {e.id for e in load_effects()}


@pytest.mark.parametrize("name", [e.id for e in load_effects()])
def test_every_effect_is_finite_within_its_bounds_and_names_known_look_alikes(name):
    motion, known = sinusoid(), {e.id for e in load_effects()}
    each = effect(name)
    assert set(each.confused_with) <= known
    for variant in each.variants:
        bounds = variant.bounds(Reference(AMPLITUDE, 2 * np.pi * FREQUENCY * AMPLITUDE))
        # At its lowest bounds a hardening Bouc-Wen state grows as exp(A/θ_y); a fit passes over what is not finite.
        for values in (bounds[:, 1], np.sqrt(bounds.prod(axis=1))) if bounds.size else (np.empty(0),):
            assert np.all(np.isfinite(variant.along(motion, values)))


@pytest.mark.parametrize("path", sorted(LIBRARIES.glob("*/*.toml")), ids=lambda path: path.stem)
def test_what_ships_passes_the_checks_of_a_file_of_ones_own(path, tmp_path):
    # A process takes the shipped file as it is; a copy of it is checked.
    shutil.copy(path, tmp_path / "mine.toml")
    assert read_effects(tmp_path / "mine.toml") == read_effects(path)


def test_jenkins_loop_has_its_closed_area():
    """Energy per cycle 4·k·θ_y·(A − θ_y) of a spring and slider in series (A > θ_y)."""
    motion, yields = sinusoid(), 2e-4
    column = effect("jenkins_element").variants[0].along(motion, np.array([yields]))[:, 0]
    # One part in a thousand: the corner falls between samples of a 720-point period.
    assert work(column, motion) == pytest.approx(4 * yields * (AMPLITUDE - yields), rel=2e-3)


@pytest.mark.parametrize("shape", [0.3, 1.0, 1.8])
def test_iwan_sliders_dissipate_what_each_does_alone(shape):
    """Σ 4·k·y·(A − y) over sliders that all yield, their stiffnesses y**(shape − 1) and one in sum (Iwan 1966)."""
    motion, largest = sinusoid(), 8e-4
    column = effect("iwan_microslip").variants[0].along(motion, np.array([largest, shape]))[:, 0]
    place = np.arange(1, 8, 2) / 8
    share = place ** (shape - 1) / np.sum(place ** (shape - 1))
    yields = largest * place
    assert work(column, motion) == pytest.approx(np.sum(4 * share * yields * (AMPLITUDE - yields)), rel=2e-3)


def test_maxwell_branch_has_the_transfer_function_of_its_time():
    """q = θ·iωτ/(1 + iωτ) in the steady state."""
    motion, tau = sinusoid(), 0.03
    column = effect("maxwell_branch").variants[0].along(motion, np.array([tau]))[:, 0]
    w = 2 * np.pi * FREQUENCY
    phasor = 2 * np.mean(column * np.exp(-1j * w * motion.time)) * 1j / AMPLITUDE
    expected = 1j * w * tau / (1 + 1j * w * tau)
    # The linearly implicit Euler step of 1/(3·720) of a period is first order: 2π/2160/2 = 0.15 %.
    assert abs(phasor - expected) < 4e-3


def test_dahl_friction_far_past_its_bristles_dissipates_as_coulomb():
    """Energy per cycle tends to 4·k·θ_y·A as θ_y/A tends to zero; the bristles take 2·θ_y of travel at each end."""
    motion, yields = sinusoid(), 8e-6
    column = effect("dahl_friction").variants[0].along(motion, np.array([yields]))[:, 0]
    assert work(column, motion) == pytest.approx(4 * yields * AMPLITUDE, rel=0.03)


def test_play_carries_nothing_within_its_gap():
    motion = sinusoid()
    column = effect("backlash_play").variants[0].along(motion, np.array([0.6e-3, 1e-5]))[:, 0]
    # After a reversal the gap of 2·0.6 mrad has to be travelled: from +1 mrad down to −0.2 mrad.
    down = (motion.rate < 0) & (motion.angle < 0.95e-3) & (motion.angle > -0.15e-3)
    assert np.all(np.abs(column[down]) < 1e-9) and np.abs(column).max() == pytest.approx(1.0)


HEAD = 'name = "mine"\ndescription = "mine"\n[[effect]]\nid = "mine"\nname = "mine"\nfamily = "x"\nmeaning = "x"\n'
BAD = {
    "unknown key": (HEAD + 'colour = "red"\n[[effect.variant]]\ncolumns = []\n', "colour", InputError),
    "no variant": (HEAD, "[[effect]] 1 (mine): key 'variant' is missing", InputError),
    "wrong unit": (
        HEAD + '[[effect.variant]]\ncolumns = [{ symbol = "k", formula = "theta**5", unit = "N*m" }]\n',
        "expected N*m/rad^5",
        UnitError,
    ),
    "forbidden": (
        HEAD + '[[effect.variant]]\ncolumns = [{ symbol = "k", formula = "__import__(1)", unit = "N*m" }]\n',
        "__import__",
        FormulaError,
    ),
    "no TOML": ("[[effect", "is not valid TOML", InputError),
    "bounds": (
        HEAD
        + '[[effect.variant]]\ncolumns = [{ symbol = "k", formula = "sign(theta)*min(abs(theta), d)", unit = '
        '"N*m/rad" }]\nparameters = [{ name = "d", unit = "rad", lower = 2.0, upper = 1.0 }]\n',
        "lower 2 is not below upper 1",
        InputError,
    ),
    "nowhere": (
        HEAD + 'enters = "roof"\n[[effect.variant]]\n',
        "enters is 'roof'; expected one of moment",
        InputError,
    ),
    "a structure has one number": (
        HEAD + 'enters = "loss factor"\n[[effect.variant]]\n',
        "has one parameter, and no columns",
        InputError,
    ),
    "a law has columns": (HEAD + "[[effect.variant]]\n", "a variant has a column at least", InputError),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(tmp_path, case):
    text, message, kind = BAD[case]
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(kind, match="mine.toml") as error:
        read_effects(path)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_a_missing_file_and_an_unknown_id_are_named(tmp_path):
    with pytest.raises(MissingInputError, match="nowhere.toml"):
        read_effects(tmp_path / "nowhere.toml")
    with pytest.raises(UnknownNameError, match="no effect 'stribek'"):
        select_effects(load_effects(), ["stribek"])


def test_a_users_effect_works_like_a_shipped_one(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        HEAD
        + '[[effect.variant]]\ncolumns = [{ symbol = "k_r", formula = "sin(theta/wave)", unit = "N*m" }]\n'
        'parameters = [{ name = "wave", unit = "rad", relative_to = "angle", lower = 0.01, upper = 0.2 }]\n'
    )
    mine = select_effects(load_effects([path]), ["mine"])[0]
    column = mine.variants[0].along(sinusoid(), np.array([5e-5]))[:, 0]
    assert np.allclose(column, np.sin(sinusoid().angle / 5e-5))
