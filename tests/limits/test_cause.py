from math import inf, nan

import pytest

from mpm_ref.limits.cause import LIMITS, NO_CONVERGENCE, RESOLUTION, SETTING, limit_counts, limit_of


@pytest.mark.parametrize(("error", "coarse_error", "is_setting", "limit"), [
    (0.1, 0.3, False, RESOLUTION),
    (0.3, 0.3, False, NO_CONVERGENCE),
    (0.3, 0.1, False, NO_CONVERGENCE),
    (0.3, inf, False, RESOLUTION),          # the run at 2 dx did not finish
    (0.3, nan, False, RESOLUTION),
    (0.3, nan, True, SETTING),
])
def test_limit_follows_from_three_grids(error, coarse_error, is_setting, limit):
    assert limit_of(error, coarse_error, is_setting) == limit


def test_cells_with_a_warning_count_as_that_alone():
    cells = [{"warnings": ("w",), "limit": RESOLUTION}, {"warnings": (), "limit": RESOLUTION},
             {"warnings": (), "limit": SETTING}, {"warnings": (), "limit": RESOLUTION}]
    counts = limit_counts(cells)
    assert counts == {RESOLUTION: 2, "a warning of the run": 1, SETTING: 1}
    assert next(iter(counts)) == RESOLUTION
    assert set(counts) - set(LIMITS) == {"a warning of the run"}
