"""From which base a diagnosis starts, on problems made by hand."""

import pytest

from sindyjoint.diagnosis.engine import explain_gap
from sindyjoint.diagnosis.result import Gap
from tests.diagnosis.handmade_problem import Based, Effect


@pytest.mark.parametrize(
    ("alone", "end", "used"),
    [
        (Gap(0.30, 0.30, 0.3), Gap(0.25, 0.42, 0.25), "right"),  # hardly worse, and ahead before the search
        (Gap(0.38, 0.30, 0.3), Gap(0.35, 0.42, 0.35), "stand_in"),
        (Gap(0.38, 0.30, 0.3), Gap(0.25, 0.25, 0.25), "right"),
    ],
)
def test_the_base_that_is_better_held_out_is_used_and_the_other_one_told(alone, end, used):
    stand_in = Effect("stand_in", 900.0, Gap(0.36, 0.27, 0.36))
    other = Based(candidates=(Effect("right", 900.0, end),), gap=alone)
    first = Based(candidates=(stand_in,), other=other)
    result = explain_gap(first, 4, lambda words: None, advised=False)
    assert [s.effect for s in result.steps] == [used] and result.verdict == "partly_named"
    (line,) = result.warnings
    given, found = "from the model as it was given", "from another base"
    assert line.startswith(
        f"the search started {found if used == 'right' else given}, which ends with a gap of"
    )
    assert f"{given if used == 'right' else found} it ends with" in line
