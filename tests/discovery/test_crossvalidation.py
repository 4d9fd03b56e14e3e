"""Leaving frequencies and levels out: folds by scikit-learn, everything found anew."""

import numpy as np
import pytest
from sklearn.model_selection import GroupKFold, LeavePGroupsOut

from sindyjoint.discovery.rows import state_columns
from sindyjoint.discovery.uncertainty import cross_validate, find
from sindyjoint.errors import InputError


def test_each_frequency_is_predicted_by_the_others(evidence):
    result = cross_validate(evidence)
    assert [fold.left_out for fold in result.folds] == [("3 Hz",), ("4 Hz",), ("5 Hz",), ("6 Hz",)]
    assert result.unanimous and result.folds[0].kept == evidence.ids[:5]
    assert all("coulomb_friction" in f.kept and "quintic_stiffness" not in f.kept for f in result.folds)
    # 1 % noise on the moment, together with that of the angle
    assert 0.009 < result.moment_error < 0.013


def test_error_is_that_of_the_rows(found, evidence, rows):
    fold = cross_validate(evidence).folds[1]
    columns = state_columns(found.regressor.terms_, rows["X"])[:, :5]
    test = rows["groups"] == "4 Hz"
    scale = np.linalg.norm(columns[~test], axis=0)
    fit = np.linalg.lstsq(columns[~test] / scale, rows["y"][~test], rcond=None)[0] / scale
    np.testing.assert_allclose(fold.coefficients, fit, rtol=1e-6)
    residual = rows["y"][test] - columns[test] @ fit
    expected = np.sqrt(np.mean(residual**2) / np.mean(rows["y"][test] ** 2))
    assert fold.moment_error == pytest.approx(expected, rel=1e-6)


def test_levels_can_be_left_out(found, evidence):
    result = cross_validate(evidence, [state.level for state in found.states])
    assert [fold.left_out for fold in result.folds] == [("0.35",), ("0.6",), ("0.9",)]
    assert {len(fold.runs) for fold in result.folds} == {4}
    # without the largest level, a stop that only it reaches is no candidate; the five terms are found all the same
    assert result.folds[0].kept == evidence.ids[:5]


@pytest.mark.parametrize(("splitter", "folds"), [(GroupKFold(2), 2), (LeavePGroupsOut(2), 6)])
def test_any_splitter_of_scikit_learn_serves(evidence, splitter, folds):
    assert len(cross_validate(evidence, splitter=splitter).folds) == folds


def test_nothing_found_predicts_nothing(evidence):
    result = cross_validate(evidence, significance=1e9)
    assert {fold.kept for fold in result.folds} == {()}
    assert result.moment_error == pytest.approx(1.0)


def test_find_leaves_out_what_these_runs_cannot_tell(evidence):
    low = type(evidence)(evidence.ids, tuple(run for run in evidence.runs if run.name.endswith("0.35")))
    found = find(low)
    assert "hard_stop" not in found.candidates
    assert found.law.keys() <= {*found.candidates}


def test_labels_that_cannot_be_left_out_are_refused(evidence):
    with pytest.raises(InputError, match="2 label\\(s\\) for 12 runs; expected one each"):
        cross_validate(evidence, ["a", "b"])
    with pytest.raises(InputError, match="all runs carry the label 'x'"):
        cross_validate(evidence, ["x"] * 12)
