"""Values as text that is equal exactly where their bits are."""

import hashlib

import numpy as np

SCALARS = (bool, int, float, np.bool_, np.integer, np.floating)


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
