"""The only place where numbers are judged, and the verdicts on stored records."""

import math

import msgspec
import pytest

from validation.common import judge as judges
from validation.common.judge import (
    COMPARATORS,
    Criterion,
    finite_ends,
    interval_of,
    judge,
    judge_printed,
)
from validation.common.record import Measurement
from validation.common.results import RESULTS, ProfileResults
from validation.common.targets import Choice, Smaller, Target, TargetFile, Targets, Tolerance, load
from validation.common.verdicts import VARIANTS, judged, printed_counts, printed_id

NOT_FINITE = (None, math.nan, math.inf, -math.inf)
JUDGED = [      # (value, rule, verdict): each end of each comparator, from both sides
    (1.0, Criterion("<=", bound=1.0), "pass"),
    (1.0 + 1e-15, Criterion("<=", bound=1.0), "miss"),
    (0.0, Criterion("<=", paper=0.0), "pass"),
    (1e-16, Criterion("<=", paper=0.0), "miss"),
    (2.4, Criterion("<=", paper=1.2, factor=2.0), "pass"),
    (2.5, Criterion("<=", paper=1.2, factor=2.0), "miss"),
    (1.0, Criterion("<", paper=1.0), "pass"),
    (1.1, Criterion("<", paper=1.0), "miss"),
    (1.0, Criterion(">=", bound=1.0), "pass"),
    (0.9, Criterion(">=", bound=1.0), "miss"),
    (5.0, Criterion(">=", paper=10.0, factor=2.0), "pass"),
    (4.9, Criterion(">=", paper=10.0, factor=2.0), "miss"),
    (1.0, Criterion(">", paper=1.0), "pass"),
    (0.9, Criterion(">", paper=1.0), "miss"),
    (3.0, Criterion("~", paper=1.0, factor=3.0), "pass"),
    (3.1, Criterion("~", paper=1.0, factor=3.0), "miss"),
    (0.33, Criterion("~", paper=1.0, factor=3.0), "miss"),
    (-2.0, Criterion("~", paper=-1.0, factor=3.0), "pass"),
    (2.0, Criterion("~", paper=-1.0, factor=3.0), "miss"),
    (0.115, Criterion("~", paper=0.11, digits=2), "pass"),
    (0.1151, Criterion("~", paper=0.11, digits=2), "miss"),
    (0.1049, Criterion("~", paper=0.11, digits=2), "miss"),
    (0.0105, Criterion("~", paper=0.01, digits=1), "pass"),
    (-1.01, Criterion("=", paper=-1.0, tolerance=0.02), "pass"),
    (-1.03, Criterion("=", paper=-1.0, tolerance=0.02), "miss"),
    (1.0 + 1e-8, Criterion("=", paper=1.0), "miss"),
    (0.0, Criterion("=", paper=0.0), "pass"),
    (1.8, Criterion("band", bound=(1.8, 2.3)), "pass"),
    (2.31, Criterion("band", bound=(1.8, 2.3)), "miss"),
    (1.79, Criterion("band", bound=(1.8, 2.3)), "miss"),
    (1e9, Criterion("info"), "info"),
    (1e9, Criterion("none", paper=1.0), "info"),
    (0.0, Criterion("runs"), "miss"),
    (1.0, Criterion("remark"), "info"),
]


@pytest.mark.parametrize(("value", "rule", "verdict"), JUDGED)
def test_verdict(value, rule, verdict):
    assert judge(value, rule)[0] == verdict


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize("rule", {rule.comparator: rule for _, rule, _ in JUDGED}.values(),
                         ids=lambda rule: rule.comparator)
def test_what_is_not_finite_misses_whatever_the_comparator(value, rule):
    """But for a remark, which is no number."""
    expected = "info" if rule.comparator == "remark" else "miss"
    assert judge(value, rule)[0] == judge_printed(value, rule)[0] == expected


@pytest.mark.parametrize(("value", "rule", "verdict"), [
    (0.5, Criterion("<=", paper=1.0), "better"),
    (0.79, Criterion("<=", paper=1.0), "better"),
    (0.81, Criterion("<=", paper=1.0), "pass"),
    (0.6, Criterion("<=", paper=1.0, factor=2.0), "pass"),
    (0.4, Criterion("<=", paper=1.0, factor=2.0), "better"),
    (1.26, Criterion(">=", paper=1.0), "better"),
    (1.24, Criterion(">=", paper=1.0), "pass"),
    (0.01, Criterion("<", paper=1.0), "pass"),
    (99.0, Criterion(">", paper=1.0), "pass"),
    (0.1, Criterion("~", paper=1.0, factor=2.0), "miss"),
    (9.0, Criterion("~", paper=1.0, factor=2.0), "miss"),
])
def test_better_than_printed_is_a_verdict_of_one_sided_claims_alone(value, rule, verdict):
    """And never a miss, nor said of a bound."""
    assert judge_printed(value, rule)[0] == verdict


@pytest.mark.parametrize(("rule", "fault"), [
    (Criterion("=<"), "unknown comparator"),
    (Criterion("<="), "needs paper= or bound="),
    (Criterion("<=", paper=1.0, bound=2.0, factor=2.0), "not both"),
    (Criterion("<=", paper=-1.0, factor=2.0), "widens nothing"),
    (Criterion("<=", paper=1.0, factor=0.5), "slack is a factor >= 1"),
    (Criterion("<=", paper=1.0, tolerance=0.1), "tolerance = 0.1 means nothing"),
    (Criterion("<", bound=1.0), "bound = 1.0 means nothing"),
    (Criterion("~", paper=0.0, factor=2.0), "not zero"),
    (Criterion("~", paper=1.0), "no width fits every number"),
    (Criterion("~", paper=1.0, factor=2.0, digits=2), "no width fits every number"),
    (Criterion("="), "needs paper="),
    (Criterion("band", bound=1.0), "bound=\\(low, high\\)"),
    (Criterion("info", bound=1.0), "bound = 1.0 means nothing"),
])
def test_incomplete_rule_is_refused(rule, fault):
    with pytest.raises(ValueError, match=fault):
        judge(1.0, rule)


@pytest.mark.parametrize(("value", "rule", "verdict"), JUDGED)
def test_a_stored_check_is_judged_as_it_was_when_it_was_made(value, rule, verdict):
    """The record has the ends of the interval, not the rule that gave them."""
    _, interval = judge(value, rule)
    record = measured("trade.toy.number", value, rule.comparator, bound=finite_ends(interval))
    assert interval_of(record.comparator, record.bound) == interval
    assert judged(record, TARGETS).verdict == verdict


MUTATED = [     # (name in `judge`, what stands in its place)
    ("_at_most", lambda rule: (-math.inf, math.inf)),
    ("_at_least", lambda rule: (-math.inf, math.inf)),
    ("_same_size", lambda rule: (rule.paper, math.inf)),
    ("_same_size", lambda rule: (-math.inf, rule.paper)),
    ("_equal", lambda rule: (rule.paper, math.inf)),
    ("_equal", lambda rule: (rule.paper - 1.0, rule.paper + 1.0)),
    ("_band", lambda rule: (rule.bound[0], math.inf)),
    ("_band", lambda rule: (-math.inf, rule.bound[1])),
    ("_everything", lambda rule: (math.inf, -math.inf)),
    ("_nothing", lambda rule: (-math.inf, math.inf)),
]


@pytest.mark.parametrize(("name", "other"), MUTATED, ids=lambda one: getattr(one, "__name__", one))
def test_each_broken_judge_changes_a_verdict(name, other, monkeypatch):
    """A mutation pass: the cases above notice each comparator whose interval is wrong."""
    sound = getattr(judges, name)
    broken = {key: other if function is sound else function
              for key, function in judges._INTERVALS.items()}
    monkeypatch.setattr(judges, "_INTERVALS", broken)
    # where nothing is judged, the interval is what changes
    changed = [rule for value, rule, verdict in JUDGED
               if judge(value, rule)[0] != verdict or judge(value, rule)[1] != sound_interval(rule)]
    assert changed
    assert {rule.comparator for rule in changed} <= {
        key for key, function in broken.items() if function is other}


SOUND = dict(judges._INTERVALS)


def sound_interval(rule):
    """Return the interval of a rule by the judges as they are."""
    return SOUND[rule.comparator](rule)


def test_every_comparator_is_among_the_cases():
    assert {rule.comparator for _, rule, _ in JUDGED} == set(COMPARATORS)


# Verdicts on stored records

def printed(id, comparator, value=1.0, kind="error", **fields):
    return Target(id=id, value=value, unit="%", what="number", paper_ref="Table 1", kind=kind,
                  comparator=comparator, confidence="exact", **fields)


NUMBERS = [printed("toy.error", "<="), printed("toy.count", "~"), printed("toy.time", "none"),
           printed("toy.picked", "<="), printed("toy.step", "=", kind="setting"),
           printed("toy.again", "<=", again="toy.error"), printed("toy.never", "<="),
           printed("toy.printed.step", "=")]
TARGETS = Targets({t.id: t for t in NUMBERS}, [TargetFile(
    "toy", [], tolerance=[Tolerance(["toy.count"], "why", factor=2.0)],
    chosen=[Choice(["toy.picked", "toy.error.modes", "trade.picked"], "on the test")])])
SMALLER = Targets(TARGETS, [TargetFile("toy", [], tolerance=[], chosen=[
    Choice(["toy.picked", "toy.error.modes"], "on the test")],
    smaller=[Smaller(["toy.*"], "an eighth of the points")])])


def measured(id, value, comparator="printed", **fields):
    return Measurement(target=id, value=value, unit="%", comparator=comparator, scale="",
                       seconds=1.0, seed=0, command="", commit="", date="", cores=2, **fields)


@pytest.mark.parametrize(("record", "kind", "verdict"), [
    (measured("toy.error", 1.0), "result", "pass"),
    (measured("toy.error", 0.5), "result", "better"),
    (measured("toy.error", None), "result", "miss"),
    (measured("toy.error", 2.0, "info"), "result", "miss"),
    (measured("toy.error", 2.0, "<=", bound=9.0), "result", "miss"),
    (measured("toy.count", 1.9), "result", "pass"),
    (measured("toy.time", 99.0), "result", "info"),
    (measured("toy.time", None), "result", "miss"),
    (measured("toy.step", 1.0), "setting", "pass"),
    (measured("toy.step", 1.1), "setting", "miss"),
    (measured("toy.picked", 0.5), "result", "chosen"),
    (measured("toy.picked", 1.5), "result", "miss"),
    (measured("toy.error.modes", 0.5), "variant", "chosen"),
    (measured("toy.count.modes.stand-in", 3.0), "variant", "miss"),
    (measured("toy.count.own", 3.0, "info"), "own", "info"),
    (measured("toy.error.partial", 0.5), "variant", "uncredited"),
    (measured("toy.error.partial", 1.5), "variant", "miss"),
    (measured("toy.count.modes.small", 1.0), "variant", "uncredited"),
    (measured("trade.toy", None, "info"), "own", "miss"),
    (measured("trade.picked", 1.0, "<=", bound=2.0), "own", "chosen"),
    (measured("trade.toy", None, "runs"), "own", "miss"),
    (measured("trade.toy", None, "remark"), "remark", "info"),
])
def test_a_record_is_judged_by_todays_rules(record, kind, verdict):
    """Whatever rule an experiment stored for a printed number."""
    one = judged(record, TARGETS)
    assert (one.kind, one.verdict) == (kind, verdict)


@pytest.mark.parametrize(("id", "profile", "verdict"), [
    ("toy.error", "standard", "uncredited"), ("toy.error", "quick", "uncredited"),
    ("toy.error", "standard --seed 3", "uncredited"), ("toy.error", "paper", "better"),
    ("toy.error", "paper --seed 3", "better"), ("toy.picked", "standard", "chosen"),
    ("toy.error.modes", "standard", "chosen"), ("toy.error.partial", "paper", "uncredited")])
def test_a_result_of_smaller_scenes_gets_no_credit(id, profile, verdict):
    command = f"python -m validation run toy --profile {profile}"
    record = msgspec.structs.replace(measured(id, 0.5), command=command)
    assert judged(record, SMALLER).verdict == verdict
    assert judged(msgspec.structs.replace(record, value=9.0), SMALLER).verdict == "miss"


def test_a_setting_has_no_size():
    command = "python -m validation run toy --profile standard"
    record = msgspec.structs.replace(measured("toy.step", 1.0), command=command)
    assert judged(record, SMALLER).verdict == "pass"


def test_a_changed_rule_changes_the_verdict_of_a_stored_record():
    record = measured("toy.count", 1.9)
    stricter = Targets(TARGETS, [TargetFile(
        "toy", [], tolerance=[Tolerance(["toy.count"], "why", factor=1.5)])])
    assert (judged(record, TARGETS).verdict, judged(record, stricter).verdict) == ("pass", "miss")


def test_ids_of_another_method_are_printed_ones_with_words_behind():
    assert printed_id("toy.error.modes.stand-in", TARGETS) == ("toy.error", ("modes", "stand-in"))
    assert printed_id("toy.error", TARGETS) == ("toy.error", ())
    assert printed_id("toy.error.mode", TARGETS) == (None, ())
    assert printed_id("modes", TARGETS) == (None, ())
    assert all(text and not text.endswith(".") for text in VARIANTS.values())


def test_a_printed_result_counts_once_and_for_the_papers_own_method():
    records = [measured("toy.error", 0.5), measured("toy.count.modes", 1.0),
               measured("toy.time", 1.0), measured("toy.step", 1.0), measured("trade.own", 1.0)]
    assert printed_counts("toy", records, TARGETS) == {
        "better": 1, "other": 1, "info": 1, "absent": 2}
    both = [*records, measured("toy.count", 9.0)]
    assert printed_counts("toy", both, TARGETS)["miss"] == 1
    assert printed_counts("trade", records, TARGETS) == {}


def test_a_record_stores_no_verdict():
    assert "verdict" not in {field.name for field in msgspec.structs.fields(Measurement)}


@pytest.mark.parametrize("profile", ["standard", "paper"])
def test_every_judged_number_that_is_published_can_miss(profile):
    """Its interval has an end, so that some value lies beyond."""
    published, numbers = ProfileResults(RESULTS / profile), load()
    found = [judged(record, numbers) for id in published.ids() for record in published.records(id)]
    passing = [one for one in found if one.verdict in ("pass", "better", "chosen")]
    assert len(passing) > 5
    assert all(any(map(math.isfinite, one.interval)) for one in passing)
