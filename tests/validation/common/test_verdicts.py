"""The only place where numbers are judged."""

import math

import pytest

from validation.common.record import Rule, judge


@pytest.mark.parametrize(("value", "rule", "verdict"), [
    (1.0, Rule("<=", bound=1.0), "pass"), (1.0 + 1e-15, Rule("<=", bound=1.0), "miss"),
    (0.0, Rule("<=", paper=0.0), "pass"), (1e-16, Rule("<=", paper=0.0), "miss"),
    (2.4, Rule("<=", paper=1.2, factor=2.0), "pass"),
    (2.5, Rule("<=", paper=1.2, factor=2.0), "miss"),
    (1.0, Rule(">=", bound=1.0), "pass"), (0.9, Rule(">=", bound=1.0), "miss"),
    (5.0, Rule(">=", paper=10.0, factor=2.0), "pass"),
    (4.9, Rule(">=", paper=10.0, factor=2.0), "miss"),
    (3.0, Rule("~", paper=1.0), "pass"), (3.1, Rule("~", paper=1.0), "miss"),
    (0.34, Rule("~", paper=1.0), "pass"), (0.33, Rule("~", paper=1.0), "miss"),
    (-2.0, Rule("~", paper=-1.0), "pass"), (2.0, Rule("~", paper=-1.0), "miss"),
    (1.4, Rule("~", paper=1.0, factor=1.3), "miss"),
    (-1.01, Rule("=", paper=-1.0, tolerance=0.02), "pass"),
    (-1.03, Rule("=", paper=-1.0, tolerance=0.02), "miss"),
    (1.0 + 1e-8, Rule("=", paper=1.0), "miss"), (0.0, Rule("=", paper=0.0), "pass"),
    (1.8, Rule("band", bound=(1.8, 2.3)), "pass"), (2.31, Rule("band", bound=(1.8, 2.3)), "miss"),
    (1e9, Rule("info"), "info"), (None, Rule("info"), "info"),
    (None, Rule("<=", bound=1.0), "miss"), (math.nan, Rule("<=", bound=1.0), "miss"),
    (-math.inf, Rule("<=", bound=1.0), "miss"), (math.inf, Rule(">=", bound=1.0), "miss"),
    (0.0, Rule("runs"), "miss"),
])
def test_verdict(value, rule, verdict):
    assert judge(value, rule)[0] == verdict


@pytest.mark.parametrize(("rule", "said"), [
    (Rule("<"), "unknown comparator"),
    (Rule("<="), "needs paper= or bound="),
    (Rule("<=", paper=1.0, bound=2.0, factor=2.0), "not both"),
    (Rule("<=", paper=-1.0, factor=2.0), "widens nothing"),
    (Rule("<=", paper=1.0, factor=0.5), "slack is a factor >= 1"),
    (Rule("<=", paper=1.0, tolerance=0.1), "tolerance = 0.1 means nothing"),
    (Rule("~", paper=0.0), "not zero"),
    (Rule("="), "needs paper="),
    (Rule("band", bound=1.0), "bound=\\(low, high\\)"),
    (Rule("info", bound=1.0), "bound = 1.0 means nothing"),
])
def test_incomplete_rule_is_refused(rule, said):
    with pytest.raises(ValueError, match=said):
        judge(1.0, rule)
