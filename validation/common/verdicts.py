"""Verdicts on stored records: a function of the stored value and of the rules of today.

Three kinds of numbers are never mixed: printed results, printed settings, and our own checks. The
paper's id belongs to the paper's method and bodies; another method has its id with a word behind it
(`nsf.jelly.error.modes`). It is judged by the same rule, and is no reproduction of the number.
"""

from collections import Counter
from typing import NamedTuple

from .judge import interval_of, judge_printed, verdict_in

VARIANTS = {        # words behind the id of a printed number
    "modes": "fields of modes in place of the paper's networks",
    "weighted": "samples with weights by cubature in place of random ones",
    "plain": "narrower networks than the paper's, on coordinates of modes",
    "waves": "networks as with `plain`, two of which read sines and cosines of places",
    "positions": "a map that is trained on positions alone, without F and v",
    "repaired": "as the text describes the method; the printed number is of the authors' release, "
                "which has faults",
    "admissible": "laws that thermodynamics admits in place of the paper's",
    "narrow": "a graph network of another size than the paper's",
    "stand-in": "a body in place of one whose mesh is not part of the repository",
    "displacement": "relative to the displacement instead of the distance from the origin",
    "partial": "over fewer runs than the printed number",
    "small": "at another size than the printed number",
    "evolved": "deformation gradients evolved on the grid in place of the map's",
    "cheap": "with options that the paper does not have, chosen for speed",
}
INCOMPLETE = {"partial", "small"}       # such a number gets no credit, as fewer steps err less; nor
                                        # one that `targets.Smaller` names
KINDS = ("result", "setting", "variant", "own", "remark")


class Judged(NamedTuple):
    """A record's number, judged."""

    kind: str               # of KINDS
    verdict: str            # of `judge.VERDICTS`
    interval: tuple         # of accepted values
    target: object          # the printed `Target`, or None
    variants: tuple         # words of VARIANTS


def printed_id(record_id, targets):
    """Return (id of the printed number, words of VARIANTS behind it), or (None, ()) of others."""
    base, variants = record_id, []
    while base not in targets:
        base, _, word = base.rpartition(".")
        if word not in VARIANTS:
            return None, ()
        variants.insert(0, word)
    return base, tuple(variants)


def judged(record, targets):
    """Return the `Judged` of a `Measurement`, by the rules of `Targets`."""
    base, variants = printed_id(record.target, targets)
    if base is None:
        interval = interval_of(record.comparator, record.bound)
        verdict = verdict_in(interval, record.value, record.comparator)
        kind = "remark" if record.comparator == "remark" else "own"
        return Judged(kind, chosen(record, targets, verdict), interval, None, ())
    target = targets[base]
    verdict, interval = judge_printed(record.value, targets.criterion(base))
    kind = "variant" if variants else "setting" if target.kind == "setting" else "result"
    verdict = chosen(record, targets, verdict)
    smaller = kind != "setting" and targets.is_smaller(record)
    if passes(verdict) and (INCOMPLETE & {*variants} or smaller):
        verdict = "uncredited"
    return Judged(kind, verdict, interval, target, variants)


def chosen(record, targets, verdict):
    """Return the verdict, or "chosen" where a value that passes was picked on its own runs."""
    return "chosen" if passes(verdict) and targets.choice(record.target) else verdict


def passes(verdict):
    """Return whether a verdict says that a number is as printed or better."""
    return verdict in ("pass", "better")


def overruled(target):
    """Return whether a ruling has replaced a printed value, which stays for the record only."""
    return target.id.split(".")[1] == "printed"


def printed_counts(paper, records, targets):
    """Return a `Counter` of the verdicts on the printed results of a paper: each number once, by
    the paper's own method; "other" counts those that another method or body alone has, "absent"
    those without any record. records: of all experiments.
    """
    verdicts, others = {}, set()
    for record in records:
        base, variants = printed_id(record.target, targets)
        if base is not None and variants:
            others.add(base)
        elif base is not None:
            verdicts[base] = judged(record, targets).verdict
    numbers = [t.id for t in targets.values() if t.kind != "setting" and not t.again
               and t.id.split(".")[0] == paper and not overruled(t)]
    return Counter(verdicts.get(id, "other" if id in others else "absent") for id in numbers)
