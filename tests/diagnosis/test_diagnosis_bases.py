"""From which base a diagnosis starts, on problems made by hand."""

import pytest

from sindyjoint.diagnosis import Gap, explain_gap
from tests.diagnosis.handmade_problem import Based, Effect


@pytest.mark.parametrize(("end", "used"), [(0.30, "right"), (0.42, "stand_in")])
def test_the_end_that_costs_less_is_used_and_the_other_one_told(end, used):
    stand_in = Effect("stand_in", 900.0, Gap(0.36, 0.27))
    other = Based(candidates=(Effect("right", 900.0, Gap(end, end)),), gap=Gap(0.5, 0.5))
    first = Based(candidates=(stand_in,), other=other)
    result = explain_gap(first, 4, lambda words: None, advised=False)
    assert [s.effect for s in result.steps] == [used] and result.verdict == "partly_named"
    (line,) = result.warnings
    given, found = "from the model as it was given", "from another base"
    assert line.startswith(
        f"the search started {found if used == 'right' else given}, which ends with a gap of"
    )
    assert f"{given if used == 'right' else found} it ends with" in line
