"""Sizes of the networks of LDM-tab1."""

HIDDEN = (30, 30, 30, 30)                               # layers of the decoder; the release of
                                                        # LDM's training has one more
KERNEL, STRIDE, SHORTEST, FEATURES = 6, 2, 32, 32       # of the encoder


def lengths(n):
    """Lengths of a row of n values before and after each convolution of the encoder: as many
    convolutions as leave at least SHORTEST values.
    """
    found = [n]
    while (found[-1] - KERNEL) // STRIDE + 1 >= SHORTEST:
        found.append((found[-1] - KERNEL) // STRIDE + 1)
    return found
