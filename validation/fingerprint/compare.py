"""Values as text that is equal exactly where their bits are, and comparison of two records."""

import hashlib

import numpy as np

SCALARS = (bool, int, float, np.bool_, np.integer, np.floating)
RAISES = "one of the two raises an exception"


def fingerprint(values):
    """Return {label: text or list of texts} of nested values {label: value}.

    Tuples, lists and dicts are followed by position, whatever their fields are called. Strings and
    None are left out, since they are prose or choices, not results.
    """
    return {label: text(leaf) for name, value in values.items()
            for label, leaf in leaves(name, value)}


def leaves(label, value):
    """Yield (label, leaf) of an array, a number, a sequence of numbers or a nest of these."""
    if isinstance(value, np.ndarray) or isinstance(value, SCALARS):
        yield label, value
    elif isinstance(value, dict | tuple | list):
        items = list(value.values()) if isinstance(value, dict) else list(value)
        if items and all(isinstance(item, SCALARS) for item in items):
            yield label, items
        else:
            for k, item in enumerate(items):
                yield from leaves(f"{label}.{k}", item)
    elif value is not None and not isinstance(value, str):
        raise TypeError(f"{label}: a value of type {type(value).__name__} has no fingerprint")


def text(leaf):
    """Return an array's dtype, shape and sha256, a number's bits, or a list of numbers' bits."""
    if isinstance(leaf, np.ndarray):
        data = np.ascontiguousarray(leaf)
        return f"{data.dtype.str} {leaf.shape} {hashlib.sha256(data.tobytes()).hexdigest()}"
    if isinstance(leaf, list):
        return [text(one) for one in leaf]
    if isinstance(leaf, float | np.floating):
        return float(leaf).hex()
    return str(int(leaf))


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
        elif labels := entry_differences(recorded[name], computed[name]):
            differences[name] = labels
    return differences


def entry_differences(one, other):
    """Return the labels or sentences in which two entries of a case differ."""
    raised = [entry["raises"] is not None for entry in (one, other)]
    if all(raised):
        return []
    if any(raised):
        return [f"{RAISES}: {one['raises'] or other['raises']}"]
    return differing(one["values"], other["values"])


def machine_differences(one, other):
    """Return a sentence for each fact in which two machines, {fact: value}, differ."""
    return [f"{fact}: recorded with {one.get(fact)}, here {other.get(fact)}"
            for fact in differing(one, other)]
