"""Numbers that lie in a long valley of nearly equal fits have intervals that hold all of it."""

from dataclasses import dataclass

import numpy as np
import pytest

from benchmarks.bench_elements import one
from sindyjoint.diagnosis.campaign.numbers.likeness import Likeness
from sindyjoint.diagnosis.campaign.numbers.valley import SIGMAS95, walk

# Of the shape; what is left is (b − curve(s)) / 0.1 and profile(s), the best b for a shape on the curve.
RANGE = (1.05, 3.0)


@dataclass(frozen=True, eq=False)
class Law(Likeness):
    """Of a number b and a shape s, in the place of a simulated law."""

    curve: object = None
    profile: object = None

    def left(self, values):
        b, s = values
        return None, np.array([(b - self.curve(s)) / 0.1, self.profile(s)])


def valley_of(curve, profile, best):
    ends = np.array([[-np.inf, RANGE[0]], [np.inf, RANGE[1]]])
    law = Law(
        None, None, None, np.zeros(2), np.full(2, 1e-4), ends, np.ones(2, dtype=bool), np.array([0, 1]), curve, profile
    )  # fmt: skip
    here = np.array([curve(best), best])
    rest, slopes = law.left(here)[1], np.zeros((2, 2))
    assert law.renew(slopes, law.own, here, rest)
    covariance = np.linalg.inv((slopes / 1e-4).T @ (slopes / 1e-4))
    errors = (covariance[1] / np.sqrt(covariance[1, 1]), 1.0)
    return walk(law, (float(rest @ rest), here), slopes, 1, errors), here, covariance


def test_a_parabola_keeps_its_covariance():
    valley, here, covariance = valley_of(lambda s: 3 * s, lambda s: (s - 2) / 0.2, 2.0)
    assert valley.ends[:, 1] == pytest.approx([2 - 0.2 * SIGMAS95, 2 + 0.2 * SIGMAS95], rel=0.02)
    assert valley.widened(here, covariance) == pytest.approx(covariance, rel=0.1)


def test_a_long_valley_widens_all_numbers_along_it():
    # Steep at its beginning, which a search found; flat on the way to its lowest point, and up to the end of the range.
    valley, here, covariance = valley_of(lambda s: s**2, lambda s: 0.5 * np.tanh(20 * (1.5 - s)) - 0.6, 1.5)
    # Fits of the others end where χ² gains less than 2 % of its limit: 0.03 of b.
    assert valley.values[-1, 1] == RANGE[1]
    assert valley.values[:, 0] == pytest.approx(valley.values[:, 1] ** 2, abs=0.03)
    wide = np.sqrt(np.diag(valley.widened(here, covariance)))
    assert np.all(wide > 3 * np.sqrt(np.diag(covariance)))
    assert SIGMAS95 * wide[1] >= RANGE[1] - 1.5 and SIGMAS95 * wide[0] >= 0.99 * (RANGE[1] ** 2 - 1.5**2)
    assert np.linalg.eigvalsh(valley.widened(here, covariance)).min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1036, 2122])
def test_a_shape_that_runs_do_not_determine_is_said_and_held(seed):
    found = one("bouc_wen_hysteresis", seed, 0.06, 0.01, refine=False, every=False, quick=True)
    for name, truth in found["truth"].items():
        _, _, low, high = found["numbers"][name]
        assert low <= truth <= high, name
    if seed == 1036:
        assert any(
            "do not determine the numbers of Bouc-Wen hysteresis one by one" in n for n in found["notes"]
        )
