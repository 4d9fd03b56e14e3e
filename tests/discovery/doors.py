"""Three ways to the same joint model from the same rows: plain pysindy with two parts, the estimator, ``discover``."""

import numpy as np
import pysindy

from sindyjoint import JointRegressor, TermLibrary, UniqueShareSTLSQ, discover
from sindyjoint.equation import default_candidates
from sindyjoint.soundness import check_data
from sindyjoint.states import campaign_states, regression_rows


def prepared(campaign):
    """Return the rows and the candidates that ``discover`` has: faulty samples left out, gravity where it shows."""
    usable = check_data(campaign).usable
    states = campaign_states(usable)
    largest = max(float(np.abs(s.angle).max()) for s in states)
    return regression_rows(states, campaign.joint.inertia), default_candidates(largest, campaign.joint.motion)


def by_sindy(campaign):
    """Return what ``pysindy.SINDy`` finds with the library and the optimizer of this package: id to coefficient.

    Columns are there in full and are decomposed by QR; the other two doors accumulate products of compiled terms.
    """
    rows, candidates = prepared(campaign)
    library = TermLibrary(candidates, include_inertia=campaign.joint.inertia is None)
    replicate = np.asarray(library.fit(rows.X).transform(rows.X_replicate)), rows.y_replicate
    optimizer = UniqueShareSTLSQ(groups=rows.groups, runs=rows.runs, blocks=rows.blocks, replicate=replicate)
    model = pysindy.SINDy(feature_library=library, optimizer=optimizer)
    model.fit(rows.X, 1e-3, x_dot=rows.y[:, None])
    values = library.physical_coefficients(model.coefficients())[0]
    return {name: value for name, value in zip(model.get_feature_names(), values, strict=True) if value}


def by_estimator(campaign):
    """Return what ``JointRegressor`` finds."""
    rows, candidates = prepared(campaign)
    return _terms(JointRegressor(candidates).fit(**rows.fit_arguments()).model_)


def by_discover(campaign):
    """Return what ``discover`` finds before any correction of bias, on data that the check would stop at, too."""
    accept = tuple(finding.id for finding in check_data(campaign).stopping)
    return _terms(discover(campaign, correct=False, accept=accept).model)


def _terms(model):
    return {term.id: term.coefficient for term in model.terms}


DOORS = (by_sindy, by_estimator, by_discover)


def difference(models):
    """Return the largest relative difference of a coefficient to the first model's; infinite where terms differ."""
    first, *others = models
    if any(set(other) != set(first) for other in others):
        return np.inf
    return max((abs(other[name] / first[name] - 1) for other in others for name in first), default=0.0)
