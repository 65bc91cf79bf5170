"""Learning rates over a training, as functions of the share of it that is done."""

from math import cos, pi

FASTEST, SLOWEST = 1e-3, 1e-6               # at the first and the last step (LDM-appB)
PRINTED = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5)    # one after the other, as many epochs each (NSF-train)


def cosine(progress):
    """From FASTEST to SLOWEST by half a cosine."""
    return SLOWEST + 0.5 * (FASTEST - SLOWEST) * (1.0 + cos(pi * progress))


def steps(progress):
    """Down the rates of PRINTED in equal shares."""
    return PRINTED[int(progress * len(PRINTED))]


SCHEDULES = {"cosine": cosine, "steps": steps}
