"""How neural laws are trained: what one epoch is, and how steep (NCLAW-train)."""

from dataclasses import dataclass

from .teacher import Teacher

RELEASE, PRINTED = "release", "printed"
READINGS = (RELEASE, PRINTED)
SEEDS = 2**32       # that PyTorch tells apart


@dataclass(frozen=True)
class Recipe:
    """An epoch is one trajectory, in segments (see `Teacher`), and one step of Adam for each law.

    Rates fall to 0 by half a cosine; the gradients of each law are cut to a norm of `clip`. The
    loss of the authors' "release" is the sum over steps of mean squared errors [m^2] times `scale`
    times segments over steps: not printed, and part of the recipe, since gradients are small beside
    the 1e-8 that Adam adds to their size. The "printed" one is the mean over steps, in m^2.
    `batch` segments run side by side, which changes nothing but time and round-off. `seed` is that
    of the laws' start, and of the order of pairs (see `labeled`). `velocity` [s^2] weighs squared
    errors of velocities beside those of positions (NCLAW-aux, printed without its value).
    """

    epochs: int = 300
    elastic_rate: float = 1.0
    plastic_rate: float = 0.1
    clip: float = 0.1
    first: int = 25             # horizon of the teacher at the first epoch [steps]
    last: int = 200             # ... and after the last
    reading: str = RELEASE
    scale: float = 1e4
    seed: int = 0
    batch: int = 8
    velocity: float = 0.0

    def __post_init__(self):
        for name in ("epochs", "first", "last", "batch"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected at least 1")
        for name in ("elastic_rate", "plastic_rate", "clip", "scale"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} = {getattr(self, name)}: expected a positive number")
        if not 0.0 <= self.velocity < float("inf"):
            raise ValueError(f"velocity = {self.velocity}: expected a number >= 0")
        if not 0 <= self.seed < SEEDS:
            raise ValueError(f"seed = {self.seed}: expected 0 .. {SEEDS - 1}")
        if self.reading not in READINGS:
            raise ValueError(f"reading = {self.reading!r}: expected {' or '.join(READINGS)}")

    @property
    def teacher(self):
        """`Teacher` of the horizons."""
        return Teacher(self.first, self.last)

    def weight(self, segments, steps):
        """What the sum over steps of mean squared errors is multiplied with."""
        return self.scale * segments / steps if self.reading == RELEASE else 1.0 / steps
