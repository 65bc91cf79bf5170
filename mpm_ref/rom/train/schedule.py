"""Learning rates over a training, as functions of the share of it that is done."""

from math import cos, pi

FASTEST, SLOWEST = 1e-3, 1e-6               # at the first and the last step (LDM-appB)
FAST, SOON = 5e-3, 0.01                     # reached after such a share of a training
PRINTED = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5)    # one after the other, as many epochs each (NSF-train)


def cosine(progress):
    """From FASTEST to SLOWEST by half a cosine."""
    return down(FASTEST, progress)


def warm(progress):
    """Up to FAST in equal steps, and from there to SLOWEST by half a cosine."""
    if progress < SOON:
        return FAST * progress / SOON
    return down(FAST, (progress - SOON) / (1.0 - SOON))


def down(fastest, share):
    """From a rate to SLOWEST by half a cosine, of which a share is done."""
    return SLOWEST + 0.5 * (fastest - SLOWEST) * (1.0 + cos(pi * share))


def steps(progress):
    """Down the rates of PRINTED in equal shares."""
    return PRINTED[int(progress * len(PRINTED))]


SCHEDULES = {"cosine": cosine, "steps": steps, "warm": warm}
