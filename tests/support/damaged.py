"""Files of arrays that must be refused, and what is said of them."""

import numpy as np
import pytest


def refused(load, path, said):
    """What a refusal says: the path, what is wrong, what to do, in one line; said: a pattern."""
    with pytest.raises(ValueError, match=said) as refusal:
        load(path)
    text = str(refusal.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    assert "; " in text
    return text


def assert_damage_is_told(load, save, path):
    """Of a file that is not there, has one other bit, is cut short, or is no archive at all."""
    refused(load, path, "cannot be read: No such file")
    save(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    refused(load, path, "is damaged, cut short")
    path.write_bytes(content[:100])
    refused(load, path, "is damaged, cut short")
    path.write_text("no archive")
    refused(load, path, "is not an npz file")


def without(*names):
    """A function of the arrays of a file: the others."""
    return lambda a: {key: value for key, value in a.items() if key not in names}


def changed(**arrays):
    """A function of the arrays of a file: all, some of them changed, by functions or values."""
    return lambda a: {**a, **{name: np.array(change(a[name]) if callable(change) else change)
                              for name, change in arrays.items()}}
