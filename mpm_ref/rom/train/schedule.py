"""Learning rates over a training, as functions of the share of it that is done."""

from math import cos, pi

FASTEST, SLOWEST = 1e-3, 1e-6               # at the first and the last step (LDM-appB)
FAST, SOON = 5e-3, 0.01                     # reached after such a share of a training
PRINTED = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5)    # one after the other, as many epochs each (NSF-train)


def cosine(progress):
    """Return the rate that falls from FASTEST to SLOWEST by half a cosine."""
    return half_cosine(FASTEST, progress)


def warm(progress):
    """Return the rate that rises to FAST in equal steps, and falls to SLOWEST by half a cosine."""
    if progress < SOON:
        return FAST * progress / SOON
    return half_cosine(FAST, (progress - SOON) / (1.0 - SOON))


def half_cosine(fastest, share):
    """Return the rate after a share of half a cosine from `fastest` to SLOWEST."""
    return SLOWEST + 0.5 * (fastest - SLOWEST) * (1.0 + cos(pi * share))


def steps(progress):
    """Return the rates of PRINTED one after the other, in equal shares."""
    return PRINTED[int(progress * len(PRINTED))]


SCHEDULES = {"cosine": cosine, "steps": steps, "warm": warm}
