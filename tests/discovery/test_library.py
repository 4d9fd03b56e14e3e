"""TermLibrary inside pysindy and scikit-learn."""

import pickle

import numpy as np
import pysindy
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from sindyjoint import TermLibrary
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.paper import TERMS
from tests.conftest import LIBRARIES

# Table 1 of the paper, averages: k1, k2, k3, c1, M_F.
TRUTH = dict(zip(TERMS, (6.066e3, -1.927e5, -2.684e9, 48.13, 1.867), strict=True))


def trajectories(samples=2000):
    """Return noise-free sinusoidal motion at four frequencies and three amplitudes, and the five-term moment."""
    states, moments, times = [], [], []
    for index, (f, amplitude) in enumerate((f, a) for f in (3, 4, 5, 6) for a in (8e-4, 5.5e-4, 3e-4)):
        t = np.arange(samples + 10 * index) / samples
        theta = amplitude * np.sin(2 * np.pi * f * t + 0.1)
        omega = amplitude * 2 * np.pi * f * np.cos(2 * np.pi * f * t + 0.1)
        k1, k2, k3, c1, friction = TRUTH.values()
        moment = k1 * theta + k2 * theta**2 + k3 * theta**3 + c1 * omega + friction * np.sign(omega)
        states.append(np.column_stack([theta, omega]))
        moments.append(moment[:, None])
        times.append(t)
    return states, moments, times


STATES, MOMENTS, TIMES = trajectories()
STACKED = np.concatenate(STATES)


def found(model):
    """Return {id: coefficient in physical units} of a fitted SINDy."""
    coefficients = model.feature_library.physical_coefficients(model.coefficients())[0]
    names = model.feature_library.get_feature_names()
    return {name: value for name, value in zip(names, coefficients, strict=True) if value}


@pytest.mark.parametrize("library", ["paper", "extended", ["paper", "polynomial"]])
@pytest.mark.parametrize("options", [{}, {"alpha": 0.0, "unbias": False}, {"alpha": 0.0}])
def test_plain_pysindy_finds_the_law(library, options):
    model = pysindy.SINDy(pysindy.STLSQ(threshold=0.01, **options), feature_library=TermLibrary(library))
    model.fit(STATES, TIMES, x_dot=MOMENTS)
    assert found(model) == pytest.approx(TRUTH, rel=1e-8)
    for predicted, moment in zip(model.predict(STATES), MOMENTS, strict=True):
        np.testing.assert_allclose(predicted, moment, atol=1e-8)


def test_one_trajectory_is_as_good_as_a_list():
    library = TermLibrary("paper")
    model = pysindy.SINDy(pysindy.STLSQ(threshold=0.01), feature_library=library)
    model.fit(STATES[0], TIMES[0], x_dot=MOMENTS[0])
    assert found(model) == pytest.approx(TRUTH, rel=1e-8)


def test_a_threshold_means_the_same_for_any_number_of_samples():
    kept = set()
    for samples in (100, 400, 2000):
        states, moments, times = trajectories(samples)
        model = pysindy.SINDy(pysindy.STLSQ(threshold=0.2), feature_library=TermLibrary("extended"))
        kept.add(frozenset(found(model.fit(states, times, x_dot=moments))))
    assert len(kept) == 1


def test_a_coefficient_is_the_rms_moment_of_its_term():
    model = pysindy.SINDy(pysindy.STLSQ(threshold=0.01), feature_library=TermLibrary("paper"))
    model.fit(STATES, TIMES, x_dot=MOMENTS)
    # Dry friction of 1.867 N·m has that RMS, give or take the samples at standstill.
    assert model.coefficients()[0, 4] == pytest.approx(1.867, rel=1e-3)
    rms = np.sqrt(np.mean((6.066e3 * STACKED[:, 0]) ** 2))
    assert model.coefficients()[0, 0] == pytest.approx(rms, rel=1e-8)


def test_a_column_that_is_zero_throughout_stays_zero():
    still = np.column_stack([STACKED[:, 0], np.zeros(len(STACKED))])
    library = TermLibrary("paper")
    features = np.asarray(library.fit_transform(still))
    assert np.all(features[:, 3:] == 0) and np.all(np.isfinite(features))
    np.testing.assert_array_equal(library.scales_[3:], 1.0)


def test_names_are_ids():
    library = TermLibrary("paper").fit(STACKED)
    assert library.get_feature_names() == list(TERMS)
    out = library.get_feature_names_out(["angle", "rate"])
    assert isinstance(out, np.ndarray) and out.dtype == object and list(out) == list(TERMS)
    assert library.n_features_in_ == 2 and library.n_output_features_ == library.size == 5


def test_inertia_and_the_third_column():
    states = np.column_stack([STACKED, np.linspace(-1, 1, len(STACKED))])
    library = TermLibrary("paper", include_inertia=True).fit(states)
    assert library.get_feature_names()[-1] == "inertia"
    np.testing.assert_allclose(
        np.asarray(library.transform(states))[:, -1] * library.scales_[-1], states[:, 2]
    )
    # A third column that no term needs does no harm.
    assert TermLibrary("paper").fit(states).n_output_features_ == 5
    with pytest.raises(
        InputError, match=r"term\(s\) inertia need the acceleration; give it as the third signal"
    ):
        TermLibrary("paper", include_inertia=True).fit(STACKED)


def test_clone_pickle_and_parameters():
    library = TermLibrary(["paper", "measurement"], reference={"rate": 0.1}, scale=None)
    copied = clone(library)
    assert copied.get_params()["reference"] == {"rate": 0.1} and not hasattr(copied, "terms_")
    library.fit(STACKED)
    again = pickle.loads(pickle.dumps(library))
    np.testing.assert_array_equal(again.transform(STACKED), library.transform(STACKED))
    assert copied.set_params(library="paper", scale="rms").fit(STACKED).n_output_features_ == 5
    assert "TermLibrary(" in repr(library)


def test_fitting_twice_is_fitting_once():
    fresh = TermLibrary("extended").fit(STATES[1])
    used = TermLibrary("extended").fit(STATES).fit(STATES[1])
    assert used.terms_ == fresh.terms_ and used.reference_ == fresh.reference_
    np.testing.assert_array_equal(used.scales_, fresh.scales_)


def test_in_a_pipeline():
    pipeline = make_pipeline(TermLibrary("paper"), Ridge(alpha=1e-9, fit_intercept=False))
    pipeline.fit(STACKED, np.concatenate(MOMENTS).ravel())
    coefficients = pipeline[0].physical_coefficients(pipeline[1].coef_)
    assert dict(zip(TRUTH, coefficients, strict=True)) == pytest.approx(TRUTH, rel=1e-6)
    assert pipeline[:-1].get_feature_names_out().tolist() == list(TRUTH)
    assert clone(pipeline).get_params()["termlibrary__library"] == "paper"


def test_joined_with_another_library():
    joined = TermLibrary("paper") + pysindy.FourierLibrary(n_frequencies=1)
    assert joined.fit(STACKED).transform(STACKED).shape == (len(STACKED), 5 + 4)
    assert joined.get_feature_names()[:5] == list(TRUTH)


def test_units_of_the_data_scale_the_coefficients():
    """The same motion in mrad: a stiffness per mrad is a thousandth, k3 a milliardth, friction the same."""
    model = pysindy.SINDy(pysindy.STLSQ(threshold=0.01), feature_library=TermLibrary("paper"))
    in_mrad = found(model.fit([1e3 * states for states in STATES], TIMES, x_dot=MOMENTS))
    factors = dict(zip(TRUTH, (1e-3, 1e-6, 1e-9, 1e-3, 1.0), strict=True))
    assert in_mrad == pytest.approx({name: TRUTH[name] * factors[name] for name in TRUTH}, rel=1e-8)


def test_a_path_works_as_a_name_does(tmp_path):
    source = LIBRARIES / "paper.toml"
    (tmp_path / "mine.toml").write_bytes(source.read_bytes())
    assert TermLibrary(tmp_path / "mine.toml").fit(STACKED).get_feature_names() == list(TRUTH)


@pytest.mark.parametrize(
    ("parameters", "states", "message"),
    [
        ({"scale": "max"}, STACKED, "scale is 'max'; expected 'rms' or None"),
        (
            {"reference": {"angel": 1.0}},
            STACKED,
            "reference has the key 'angel'; angle, rate and moment are known",
        ),
        (
            {},
            STACKED[:, :1],
            r"X has the shape \(\d+, 1\); expected \(n, 2\) for angle and rate, or \(n, 3\) with",
        ),
        ({}, STACKED[:0], r"X has the shape \(0, 2\)"),
        (
            {},
            np.full((4, 2), np.nan),
            "X holds a value that is not finite in row 0, column 0; remove such rows",
        ),
        ({}, [STACKED, np.zeros((5, 3))], "some trajectories have 2 columns and some 3"),
    ],
)
def test_misuse_is_named(parameters, states, message):
    with pytest.raises(InputError, match=message):
        TermLibrary("paper", **parameters).fit(states)


def test_misuse_after_fitting_is_named():
    library = TermLibrary("paper").fit(STACKED)
    with pytest.raises(InputError, match="X has 3 columns; the library was fitted to 2"):
        library.transform(np.zeros((5, 3)))
    with pytest.raises(NotFittedError):
        TermLibrary("paper").transform(STACKED)
    with pytest.raises(NotFittedError):
        TermLibrary("paper").get_feature_names()
    with pytest.raises(UnknownNameError, match="library 'papr' is unknown; did you mean 'paper'?"):
        TermLibrary("papr").fit(STACKED)
