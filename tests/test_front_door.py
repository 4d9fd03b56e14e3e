"""The front door in Python: one manner for every verb, results that show themselves, refusals that help."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sindyjoint
from sindyjoint import Campaign
from sindyjoint.errors import (
    InputError,
    OptionError,
    OutputError,
    SindyJointError,
    UnitError,
    UnknownNameError,
)
from tests.doors.inventory import parameters

VERBS = ("check", "compare", "diagnose", "discover", "init", "simulate", "verify")


@pytest.fixture(scope="module")
def campaign():
    return sindyjoint.simulate(frequencies=[3, 5], levels=[0.4, 0.7, 0.9], duration=4.0, sample_rate=500.0)


@pytest.fixture(scope="module")
def found(campaign):
    return sindyjoint.discover(campaign, correct=False)


@pytest.fixture(scope="module")
def results(campaign, found):
    return {
        "simulate": campaign,
        "check": sindyjoint.check(campaign),
        "discover": found,
        "verify": sindyjoint.verify(found.model, campaign, draws=2),
        "diagnose": sindyjoint.diagnose(campaign, found.model, advise=False, max_effects=1),
    }


def test_every_verb_is_at_the_top():
    assert set(VERBS) <= set(dir(sindyjoint)) and all(callable(getattr(sindyjoint, verb)) for verb in VERBS)


@pytest.mark.parametrize("verb", [*VERBS, "diagnose_structure"])
def test_a_misspelt_option_is_answered_with_the_nearest(verb):
    function = getattr(sindyjoint, verb)
    known = {"simulate": "random_state", "init": "force"}.get(verb, "random_state")
    with pytest.raises(OptionError, match=rf"has no option '{known[:-1]}'; did you mean '{known}'\?"):
        function(**{known[:-1]: 0})


def test_random_numbers_are_asked_for_as_spec_7_has_it():
    """A seed, a generator or what makes one, as `rng`; the older name is the same, and estimators have only that."""
    plan = {"frequencies": [4], "levels": [0.5], "duration": 1.0}
    seeds = np.random.SeedSequence(3)
    made = [
        sindyjoint.simulate(rng=each, **plan)
        for each in (3, np.random.default_rng(3), np.random.PCG64(seeds), 4)
    ]
    made.append(sindyjoint.simulate(random_state=3, **plan))
    first, *same, other, older = (each.runs[0].angle for each in made)
    assert all(np.array_equal(first, each) for each in (*same, older)) and not np.array_equal(first, other)
    with pytest.raises(OptionError, match=r"simulate\(\) got rng and random_state, which are one; give rng"):
        sindyjoint.simulate(rng=3, random_state=3)
    asked = {name: parameters(getattr(sindyjoint, name)) for name in sindyjoint.__all__}
    drawn = {name for name, own in asked.items() if "rng" in own}
    assert set(VERBS) - {"init"} | {"discover_rig", "diagnose_rig", "plan", "virtual_campaign"} <= drawn
    older = {name for name, own in asked.items() if "random_state" in own}
    assert older == {"JointRegressor", "UniqueShareSTLSQ"}


@pytest.mark.parametrize("count", [1, 2, 5, 31])
def test_arrays_of_a_few_samples_are_refused(count):
    t = np.arange(count) / 500
    with pytest.raises(InputError, match=f"{count} samples; expected at least 32"):
        Campaign.from_arrays(moment=np.sin(25 * t + 1), angle=np.sin(25 * t), rate="500 Hz")


def test_options_that_are_passed_on_are_known():
    with pytest.raises(TypeError, match=r"discover\(\) has no option 'treshold'; did you mean 'threshold'"):
        sindyjoint.discover(treshold=0.01)
    with pytest.raises(OptionError, match="did you mean 'frequencies'"):
        sindyjoint.simulate(frequencys=[3])
    with pytest.raises(AttributeError, match="has no attribute 'discvoer'; did you mean 'discover'"):
        sindyjoint.discvoer  # noqa: B018


def test_results_show_themselves(results, tmp_path):
    for name, result in results.items():
        text = str(result)
        assert len(text.splitlines()) <= 40, name
        assert len(repr(result)) < 200 and "\n" not in repr(result), name
        html = result._repr_html_()
        assert "<table" in html or "<pre>" in html, name
        assert {"plot", "to_frame", "report"} <= set(dir(result)), name
        folder = result.report(tmp_path / name)
        assert (folder / "report.html").stat().st_size > 10_000, name


def test_text_has_no_colours(found, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as a notebook's kernel does
    assert "\x1b" not in str(found) and "Can I trust it? " in str(found)


def test_a_discovery_in_a_notebook(found):
    assert found._repr_html_().count("<tr>") == len(found.model.terms) + 1
    assert "<math" in found._repr_html_()
    assert found._repr_latex_().startswith("$")
    assert str(found).startswith("inter-panel joint (simulated)")


def test_pictures(results):
    from matplotlib.figure import Figure

    for name, result in results.items():
        assert result.figures, name
        assert isinstance(result.plot(), Figure), name
    with pytest.raises(UnknownNameError, match="figure 'lops' is not known; did you mean 'loops'"):
        results["discover"].plot("lops")
    axes = Figure().add_subplot()
    assert results["discover"].plot("path-error", axes) is axes and axes.has_data()
    with pytest.raises(
        InputError, match="'path' has 2 panels and one pair of axes was given; expected one of"
    ):
        results["discover"].plot("path", axes)


def test_frames(results):
    pytest.importorskip("pandas")
    frame = results["discover"].to_frame().set_index("id")
    term = results["discover"].model["coulomb_friction"]
    assert frame.loc["coulomb_friction", "coefficient"] == term.coefficient
    assert frame.loc["coulomb_friction", "interval95_low"] == term.interval95[0]
    assert len(results["verify"].to_frame()) == 6
    assert results["simulate"].to_frame()["sample_rate"].dtype == float
    for name, result in results.items():
        assert len(result.to_frame().columns) > 3, name


def test_a_model_shows_itself(found):
    assert repr(found.model) == "<JointModel: inter-panel joint, 5 terms>"
    assert str(found.model).startswith("inter-panel joint: M = I·θ̈ + k1·θ") and "  M_F = 1.8" in str(
        found.model
    )
    assert found.model._repr_latex_() == found._repr_latex_()


def test_a_comparison_shows_its_equation_and_its_numbers(found):
    sys.path.insert(0, str(Path(__file__).parent / "reporting"))
    from handmade_results import comparison

    made = replace(comparison(), discovery=found)
    assert "<math" in made._repr_html_() and made._repr_latex_() == found._repr_latex_()
    frame = made.to_frame()
    chosen = frame[(frame["kind"] == "method") & (frame["term"] == "linear_stiffness")]
    assert chosen["coefficient"].tolist() == [5912.0, 5912.0]


def test_a_term_by_symbol_and_by_id(found):
    assert found.model["M_F"] is found.model["coulomb_friction"]
    with pytest.raises(UnknownNameError, match=r"no term 'M_f'; it has linear_stiffness \(k1\)"):
        found.model["M_f"]


def test_six_lines_from_two_arrays(campaign):
    moment, angle = [run.moment for run in campaign.runs], [1e3 * run.angle for run in campaign.runs]
    # From here on it is what a newcomer types.
    mine = Campaign.from_arrays(
        moment=moment, angle=angle, rate="500 Hz", units={"angle": "mrad"}, inertia="0.02 kg*m^2"
    )
    found = sindyjoint.discover(mine, correct=False)
    # To here.
    assert [run.frequency for run in mine.runs] == [run.frequency for run in campaign.runs]
    assert len({run.level for run in mine.runs}) == 3
    assert found.model["k1"].coefficient == pytest.approx(6061, rel=0.02)
    assert not mine.simulated and "simulated" not in repr(mine)


def frame(run):
    return {
        "room [degC]": np.full(run.n_samples, 20.0),
        "phi_mrad": 1e3 * run.angle,
        "torque": run.moment / 1e3,
        "t": run.time,
    }


def test_frames_in_any_order_of_columns(campaign):
    mine = Campaign.from_frames({run.name: frame(run) for run in campaign.runs}, units={"torque": "kN*m"})
    for run, true in zip(mine.runs, campaign.runs, strict=True):
        np.testing.assert_allclose(run.moment, true.moment)
        np.testing.assert_allclose(run.angle, true.angle)
        assert run.sample_rate == pytest.approx(500.0)
    assert "6 run(s): 3Hz-0.4, 3Hz-0.7, 3Hz-0.9, 5Hz-0.4, ..." in repr(mine)


def test_pandas_frames(campaign):
    pandas = pytest.importorskip("pandas")
    mine = Campaign.from_frames({"one": pandas.DataFrame(frame(campaign.runs[0]))}, units={"torque": "kN*m"})
    np.testing.assert_allclose(mine.runs[0].moment, campaign.runs[0].moment)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"the unit of column 'torque' \(moment\) is not told; give units=\{'torque': 'N\*m'\}"),
        ({"units": {"torqe": "N*m"}}, "units has no option 'torqe'; did you mean 'torque'"),
        ({"units": {"torque": "kN"}}, "one: holds no column for the moment; columns there: room"),
        (
            {"units": {"torque": "N*m"}, "columns": {"moment": "M"}},
            "moment = 'M' is no column; columns there",
        ),
    ],
)
def test_frames_that_do_not_tell(campaign, options, message):
    with pytest.raises(SindyJointError, match=message):
        Campaign.from_frames({"one": frame(campaign.runs[0])}, **options)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (
            {"moment": np.ones(100)},
            "arrays were given of moment; expected moment and angle, or force and displacement",
        ),
        (
            {"moment": np.ones(100), "angle": np.ones(100)},
            "neither time nor rate was given; give rate='1 kHz'",
        ),
        ({"moment": np.ones((2, 100)), "angle": np.ones(100), "rate": 100.0}, "2 of moment, 1 of angle"),
        ({"moment": np.ones(100), "angle": np.ones(100), "rate": "5 kg"}, "is not a frequency"),
        (
            {"moment": np.ones(100), "angle": np.ones(100), "rate": 9.0, "units": {"angel": "rad"}},
            "did you mean 'angle'",
        ),
    ],
)
def test_arrays_that_do_not_do(arrays, message):
    with pytest.raises(SindyJointError, match=message):
        Campaign.from_arrays(**arrays)


def test_an_estimator_takes_columns_by_their_names():
    pandas = pytest.importorskip("pandas")
    rng = np.random.default_rng(0)
    angle, rate = rng.normal(size=(2, 400))
    moment = 3 * angle + 0.2 * rate + 0.01 * rng.normal(size=400)
    by_name = pandas.DataFrame({"omega": rate, "theta": angle})
    fitted = sindyjoint.JointRegressor(library="paper").fit(by_name, moment)
    plain = sindyjoint.JointRegressor(library="paper").fit(np.column_stack([angle, rate]), moment)
    assert np.array_equal(fitted.coef_, plain.coef_)
    assert np.array_equal(fitted.predict(by_name), plain.predict(np.column_stack([angle, rate])))
    # Two angles have no order by name.
    with pytest.raises(
        InputError, match="X has the columns omega, theta, phi; expected angle, rate, acceleration"
    ):
        sindyjoint.JointRegressor(library="paper").fit(by_name.assign(phi=angle), moment)


def recorded(frequency):
    """Columns of a run of a spring with friction, unordered and in the units of its names; seed 4, 1 % noise."""
    rng, time = np.random.default_rng(4), np.arange(0, 4, 2e-3)
    phase = 2 * np.pi * frequency * time
    angle = 2e-3 * (np.sin(phase) + 0.01 * rng.standard_normal(time.size))
    moment = 4 * np.sin(phase) + np.sign(np.cos(phase)) + 0.02 * rng.standard_normal(time.size)
    return {"angle [mrad]": 1e3 * angle, "t [s]": time, "torque [N*m]": moment}


def test_data_frames_are_a_campaign():
    pandas = pytest.importorskip("pandas")
    made = sindyjoint.simulate(frequencies=[3, 6], levels=[0.9, 0.5], duration=3, random_state=2)
    frames = {
        run.name: pandas.DataFrame(
            {"angle [mrad]": 1e3 * run.angle, "t [s]": run.time, "torque [N*m]": run.moment}
        )
        for run in made.runs
    }
    found = sindyjoint.discover(frames)
    assert [run.frequency for run in found.campaign.runs] == [3.0, 3.0, 6.0, 6.0]
    assert found.model["linear_stiffness"].coefficient == pytest.approx(6061, rel=0.02)
    assert sindyjoint.verify(found.model, frames).passed
    assert len(sindyjoint.check(frames["3Hz-0.9"]).measured.runs) == 1


def test_a_data_set_of_xarray_is_a_campaign():
    xarray = pytest.importorskip("xarray")
    runs = [recorded(f) for f in (2.0, 3.0)]
    data = xarray.Dataset(
        {
            "torque": (("run", "time"), [run["torque [N*m]"] for run in runs], {"units": "N*m"}),
            "angle": (("run", "time"), [run["angle [mrad]"] for run in runs], {"units": "mrad"}),
        },
        coords={"time": ("time", runs[0]["t [s]"], {"units": "s"}), "run": ["slow", "fast"]},
    )
    campaign = Campaign.from_frames(data)
    assert [(run.name, run.frequency) for run in campaign.runs] == [("slow", 2.0), ("fast", 3.0)]
    assert campaign.runs[0].angle.max() == pytest.approx(2e-3, rel=0.05)


def test_import_stays_quick():
    program = "import sys, sindyjoint; dir(sindyjoint); assert not {'numpy', 'scipy', 'pydantic'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_errors_are_of_both_kinds():
    assert (
        issubclass(OptionError, TypeError)
        and issubclass(UnitError, ValueError)
        and issubclass(OutputError, OSError)
    )
