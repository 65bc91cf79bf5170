"""Numbers with their scales: what a sum of products passes on of the errors of its factors.

`einsum`, `collected` and the signs + - * take plain arrays, or `Rough` ones. So a formula that is
written with them computes its result from values, and the scale of its result (see `scales`) from
values with scales: |a| S_b + S_a |b| for a product, the sum of all for a sum.
"""

import numpy as np

from ..plain import transfer


class Rough:
    """Sizes of numbers, and the scales of their errors; both of one shape.

    A scale is not less than its size: each number is rounded itself.
    """

    __array_ufunc__ = None      # NumPy's arrays leave operators to this class

    def __init__(self, size, S):
        self.size, self.S = size, S

    @property
    def shape(self):
        """That of the numbers."""
        return self.size.shape

    def __getitem__(self, i):
        return Rough(self.size[i], self.S[i])

    def __add__(self, other):
        other = rough(other)
        return Rough(self.size + other.size, self.S + other.S)

    __radd__ = __sub__ = __rsub__ = __add__

    def __neg__(self):
        return self

    def __mul__(self, other):
        other = rough(other)
        return Rough(self.size * other.size, self.size * other.S + self.S * other.size)

    __rmul__ = __mul__


def rough(a, S=0.0):
    """An array with scales S of its entries, or of its rows; by default it is only rounded."""
    if isinstance(a, Rough):
        return a
    size = abs(np.asarray(a))
    S = np.asarray(S)
    S = S.reshape(S.shape + (1,) * (size.ndim - S.ndim)) if S.ndim else S
    return Rough(size, np.maximum(size, S))


def einsum(subscripts, *factors):
    """`numpy.einsum`, whose factors may be `Rough`."""
    if not any(isinstance(a, Rough) for a in factors):
        return np.einsum(subscripts, *factors)
    known = [rough(a) for a in factors]
    sizes = [a.size for a in known]
    S = sum(np.einsum(subscripts, *sizes[:k], a.S, *sizes[k + 1:]) for k, a in enumerate(known))
    return Rough(np.einsum(subscripts, *sizes), S)


def collected(q, ip, box):
    """`plain.transfer.sum_to_nodes` of a quantity that may be `Rough`."""
    if not isinstance(q, Rough):
        return transfer.sum_to_nodes(q, ip, box)
    return Rough(*(transfer.sum_to_nodes(a, ip, box) for a in (q.size, q.S)))
