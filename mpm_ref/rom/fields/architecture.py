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
    """Return the widths of a field's hidden layers (NSF-arch)."""
    return (beta * outputs,) * DEPTH


def lengths(n):
    """Return the lengths of a row of n values before and after each convolution of LDM's encoder:
    as many convolutions as leave at least SHORTEST values.
    """
    row = [n]
    while shortened(row[-1], STRIDE) >= SHORTEST:
        row.append(shortened(row[-1], STRIDE))
    return row


def nsf_lengths(n):
    """Return the lengths of a row of n values before and after each convolution of NSF's encoder:
    convolutions until at most NSF_LONGEST values are left (NSF-encoder).
    """
    row = [n]
    while row[-1] > NSF_LONGEST:
        row.append(shortened(row[-1], NSF_STRIDE))
    return row


def shortened(n, stride):
    """Return the length of a row of n values after a convolution."""
    return (n - KERNEL) // stride + 1


def one_row(dim, n):
    """Return the `Stack` for all coordinates of n points in one row (LDM-tab1)."""
    row = lengths(dim * n)
    return Stack([1] * len(row), row, STRIDE)


def row_per_axis(dim, n):
    """Return the `Stack` for n points with a row for each axis. The paper does not say how the
    coordinates are laid out; its three output channels fit this (NSF-encoder).
    """
    row = nsf_lengths(n)
    return Stack([dim] + [NSF_ROWS] * (len(row) - 1), row, NSF_STRIDE)


ENCODERS = {"encoder": one_row, "encoder-nsf": row_per_axis}
