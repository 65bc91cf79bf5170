"""The only place where numbers are judged."""

import math

import pytest

from validation.common.record import Criterion, judge


@pytest.mark.parametrize(("value", "rule", "verdict"), [
    (1.0, Criterion("<=", bound=1.0), "pass"),
    (1.0 + 1e-15, Criterion("<=", bound=1.0), "miss"),
    (0.0, Criterion("<=", paper=0.0), "pass"),
    (1e-16, Criterion("<=", paper=0.0), "miss"),
    (2.4, Criterion("<=", paper=1.2, factor=2.0), "pass"),
    (2.5, Criterion("<=", paper=1.2, factor=2.0), "miss"),
    (1.0, Criterion(">=", bound=1.0), "pass"),
    (0.9, Criterion(">=", bound=1.0), "miss"),
    (5.0, Criterion(">=", paper=10.0, factor=2.0), "pass"),
    (4.9, Criterion(">=", paper=10.0, factor=2.0), "miss"),
    (3.0, Criterion("~", paper=1.0), "pass"),
    (3.1, Criterion("~", paper=1.0), "miss"),
    (0.34, Criterion("~", paper=1.0), "pass"),
    (0.33, Criterion("~", paper=1.0), "miss"),
    (-2.0, Criterion("~", paper=-1.0), "pass"),
    (2.0, Criterion("~", paper=-1.0), "miss"),
    (1.4, Criterion("~", paper=1.0, factor=1.3), "miss"),
    (-1.01, Criterion("=", paper=-1.0, tolerance=0.02), "pass"),
    (-1.03, Criterion("=", paper=-1.0, tolerance=0.02), "miss"),
    (1.0 + 1e-8, Criterion("=", paper=1.0), "miss"),
    (0.0, Criterion("=", paper=0.0), "pass"),
    (1.8, Criterion("band", bound=(1.8, 2.3)), "pass"),
    (2.31, Criterion("band", bound=(1.8, 2.3)), "miss"),
    (1e9, Criterion("info"), "info"),
    (None, Criterion("info"), "info"),
    (None, Criterion("<=", bound=1.0), "miss"),
    (math.nan, Criterion("<=", bound=1.0), "miss"),
    (-math.inf, Criterion("<=", bound=1.0), "miss"),
    (math.inf, Criterion(">=", bound=1.0), "miss"),
    (0.0, Criterion("runs"), "miss"),
])
def test_verdict(value, rule, verdict):
    assert judge(value, rule)[0] == verdict


@pytest.mark.parametrize(("rule", "said"), [
    (Criterion("<"), "unknown comparator"),
    (Criterion("<="), "needs paper= or bound="),
    (Criterion("<=", paper=1.0, bound=2.0, factor=2.0), "not both"),
    (Criterion("<=", paper=-1.0, factor=2.0), "widens nothing"),
    (Criterion("<=", paper=1.0, factor=0.5), "slack is a factor >= 1"),
    (Criterion("<=", paper=1.0, tolerance=0.1), "tolerance = 0.1 means nothing"),
    (Criterion("~", paper=0.0), "not zero"),
    (Criterion("="), "needs paper="),
    (Criterion("band", bound=1.0), "bound=\\(low, high\\)"),
    (Criterion("info", bound=1.0), "bound = 1.0 means nothing"),
])
def test_incomplete_rule_is_refused(rule, said):
    with pytest.raises(ValueError, match=said):
        judge(1.0, rule)
