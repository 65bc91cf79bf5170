"""Comparison of two records of fingerprints."""

RAISES = "one of the two raises an exception"


def differing(one, other):
    """Return the labels whose values differ or that one of two fingerprints lacks, in order."""
    return [label for label in {**one, **other} if one.get(label) != other.get(label)]


def compare(recorded, computed):
    """Return {case: labels or sentences} of the cases that differ between two {case: entry}.

    An entry has `values`, the fingerprint, and `raises`, the exception or None. Two entries that
    raise agree, whatever they raise. A case that was not recorded, or is gone, differs.
    """
    differences = {}
    for name in {**recorded, **computed}:
        if name not in computed:
            differences[name] = ["the case is missing"]
        elif name not in recorded:
            differences[name] = ["the case was not recorded"]
        elif labels := of_entries(recorded[name], computed[name]):
            differences[name] = labels
    return differences


def of_entries(one, other):
    """Return the labels or sentences in which two entries of a case differ."""
    raised = [entry["raises"] is not None for entry in (one, other)]
    if all(raised):
        return []
    if any(raised):
        return [f"{RAISES}: {one['raises'] or other['raises']}"]
    return differing(one["values"], other["values"])


def of_machines(one, other):
    """Return a sentence for each fact in which two machines, {fact: value}, differ."""
    return [f"{fact}: recorded with {one.get(fact)}, here {other.get(fact)}"
            for fact in differing(one, other)]
