"""How a graph network is trained; by default as [GNS] trains its own."""

from dataclasses import dataclass


@dataclass(frozen=True)
class GraphRecipe:
    """Each step of Adam is shown a frame of a run, `batch` times at random, with noise on what came
    before; its loss is that of answers, summed over axes, the mean over points.

    Rates fall from `first_rate` to `last_rate`, evenly in their logarithm. [GNS] has up to 20
    million steps with 10 blocks 128 wide, batches of 2, rates of 1e-4 to 1e-6, and deviations of
    noise of 3e-4 m per frame in its text, 6.7e-4 in its code. Every `check` steps the network runs
    freely along the first `checked` of the runs, and the weights with the least error are kept.
    """

    steps: int = 20_000_000
    width: int = 128
    blocks: int = 10
    batch: int = 2
    noise: float = 3e-4         # deviation of the last velocity [m per frame]
    radius: float = 0.085       # [m]: at rest 15 neighbours of a point in NCLaw's cubes, on average
    first_rate: float = 1e-4
    last_rate: float = 1e-6
    check: int = 1000
    checked: int = 1
    seed: int = 0

    def __post_init__(self):
        for name in ("steps", "width", "blocks", "batch", "check", "checked"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected at least 1")
        for name in ("radius", "first_rate", "last_rate"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ValueError(f"{name} = {getattr(self, name)}: expected a positive number")
        if not 0.0 <= self.noise < float("inf"):
            raise ValueError(f"noise = {self.noise}: expected a number >= 0")
        if self.steps % self.check:
            raise ValueError(f"steps = {self.steps}, check = {self.check}: expected a multiple of "
                             "it, so that the last step is checked")

    @property
    def rounds(self):
        """How often the network is checked."""
        return self.steps // self.check

    def rate(self, step):
        """The rate of a step, counted from 0."""
        return self.first_rate * (self.last_rate / self.first_rate) ** (step / self.steps)
