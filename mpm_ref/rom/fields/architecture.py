"""Sizes of the networks of LDM-tab1 and NSF-arch."""

from typing import NamedTuple

HIDDEN = (30, 30, 30, 30)                               # layers of the decoder; the release of
                                                        # LDM's training has one more
DEPTH = 5                                               # hidden layers of NSF's fields
KERNEL, STRIDE, SHORTEST, FEATURES = 6, 2, 32, 32       # of the encoder
NSF_STRIDE, NSF_ROWS, NSF_LONGEST = 4, 3, 12            # ... of NSF's, where they differ


class Stack(NamedTuple):
    """One-dimensional convolutions of an encoder."""

    rows: list          # numbers of rows of values before and after each
    lengths: list       # ... and of values in a row
    stride: int


def hidden(beta, outputs):
    """Widths of a field's hidden layers (NSF-arch)."""
    return (beta * outputs,) * DEPTH


def lengths(n):
    """Lengths of a row of n values before and after each convolution of the encoder: as many
    convolutions as leave at least SHORTEST values.
    """
    found = [n]
    while shortened(found[-1], STRIDE) >= SHORTEST:
        found.append(shortened(found[-1], STRIDE))
    return found


def nsf_lengths(n):
    """The same for NSF's: convolutions until at most NSF_LONGEST values are left (NSF-encoder)."""
    found = [n]
    while found[-1] > NSF_LONGEST:
        found.append(shortened(found[-1], NSF_STRIDE))
    return found


def shortened(n, stride):
    """Length of a row of n values after a convolution."""
    return (n - KERNEL) // stride + 1


def one_row(dim, n):
    """`Stack` for all coordinates of n points in one row (LDM-tab1)."""
    found = lengths(dim * n)
    return Stack([1] * len(found), found, STRIDE)


def row_per_axis(dim, n):
    """`Stack` for n points, each axis in a row of its own. The paper does not say how the
    coordinates are laid out; its three output channels fit this (NSF-encoder).
    """
    found = nsf_lengths(n)
    return Stack([dim] + [NSF_ROWS] * (len(found) - 1), found, NSF_STRIDE)


ENCODERS = {"encoder": one_row, "encoder-nsf": row_per_axis}
