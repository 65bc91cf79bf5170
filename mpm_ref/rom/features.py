"""Sines and cosines of where a point is, beside its place: fields of them are sharper than those of
places alone (Fourier features, [Tancik2020]).

    Z -> (Z, sin(pi Z), cos(pi Z), sin(2 pi Z), cos(2 pi Z), sin(4 pi Z), cos(4 pi Z), ..)

of places Z scaled to the unit box, d numbers each: a sine and a cosine for each octave; none leaves
Z as it is. Beyond NSF, which leaves better fields for later.
"""

from math import cos, pi, sin

import numpy as np

from ..core.jit import kernel


def count(d, octaves):
    """How many numbers a place of d becomes."""
    return d * (1 + 2 * octaves)


def features(Z, octaves):
    """What scaled places Z (n, d) become: (n, d (1 + 2 octaves))."""
    if octaves == 0:
        return Z
    waves = [wave(2.0**o * pi * Z) for o in range(octaves) for wave in (np.sin, np.cos)]
    return np.concatenate([Z, *waves], axis=1)


@kernel
def fill(a, d, octaves):
    """The same of one place, whose d numbers stand at the start of a; returns how many there are
    then.
    """
    k = d
    for o in range(octaves):
        for i in range(d):
            a[k + i] = sin(2.0**o * pi * a[i])
            a[k + d + i] = cos(2.0**o * pi * a[i])
        k += 2 * d
    return k
