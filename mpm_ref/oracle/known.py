"""Arrays with the scales of their entries, and what formulas make of both (see `rough`)."""

from typing import NamedTuple

import numpy as np

from .rough import Rough, rough


class Known(NamedTuple):
    """An array, and the scales of its entries; both of one shape."""

    value: np.ndarray
    S: np.ndarray

    def at(self, i):
        """The entries at an index."""
        return Known(self.value[i], self.S[i])


def given(a, S=0.0):
    """An array with scales S of its entries or rows; by default it is only rounded."""
    return Known(a, np.broadcast_to(rough(a, S).S, a.shape))


def known(f, *inputs):
    """What f, a function of arrays or `Rough` ones, makes of records of `Known`; it is `Known`."""
    exact = f(*(mapped(a, lambda k: k.value) for a in inputs))
    return paired(exact, f(*(mapped(a, lambda k: Rough(abs(k.value), k.S)) for a in inputs)))


def mapped(a, g):
    """A record with g of everything that is `Known` in it."""
    if isinstance(a, Known):
        return g(a)
    return type(a)(*(mapped(b, g) for b in a)) if hasattr(a, "_fields") else a


def paired(exact, found):
    """Values and the scales found for them, as a record of `Known`."""
    if isinstance(found, Rough):
        return Known(exact, found.S)
    if not isinstance(found, tuple):
        return found
    pairs = [paired(*pair) for pair in zip(exact, found)]
    return type(found)(*pairs) if hasattr(found, "_fields") else tuple(pairs)


def total(parts):
    """The sum of some `Known`."""
    return Known(sum(part.value for part in parts), sum(part.S for part in parts))
