"""Training of a graph network: steps, free runs that pick the weights, checkpoints [GNS].

A round of the training is `GraphRecipe.check` steps and a free run. What is drawn in a step follows
from the seed and the step's number alone, so that a training that is cut off goes on from its last
checkpoint with the numbers of one that was not, on the same machine with the same threads.
"""

import hashlib
import json
from copy import deepcopy
from dataclasses import asdict, dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
import torch

from ....training import Diverged, TrainingSession, train_epochs
from ..features import HISTORY, FeatureSettings, Graph, SimulatorFailure
from ..simulator import Simulator, free_run
from .examples import example, random_walk, scales_of, single
from .network import GraphNetwork, export_weights


@dataclass(frozen=True)
class GraphRecipe:
    """Settings of the training: each step of Adam takes `batch` random frames of runs, with noise
    in their history; its loss is the squared error summed over axes, the mean over points.

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
        """Return the number of times that the network is checked."""
        return self.steps // self.check

    def rate(self, step):
        """Return the rate of a step, counted from 0."""
        return self.first_rate * (self.last_rate / self.first_rate) ** (step / self.steps)


SAVE = 1            # rounds between checkpoints
FORMAT = 1          # of checkpoints


class Round(NamedTuple):
    """The errors of a round of the training."""

    loss: float         # the mean over its steps
    error: float        # mean squared, of free runs [m^2]; infinite where they break down


class GraphSession(TrainingSession):
    """Network and optimiser of a training under way."""

    entry = Round._make

    def __init__(self, recipe, runs, dt):
        super().__init__()
        self.recipe, self.runs = recipe, runs
        self.reading = FeatureSettings(recipe.radius, dt, scales_of(runs, recipe.noise))
        self.digest = data_digest(runs, dt)
        torch.manual_seed(recipe.seed)
        self.network = GraphNetwork(runs[0].frames.shape[-1], recipe.width, recipe.blocks)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=recipe.first_rate)
        self.best = deepcopy(self.network)

    @property
    def description(self):
        """Return the settings of the training and the digest of its data, as one line of text."""
        return json.dumps({"format": FORMAT, **asdict(self.recipe), "data": self.digest})

    @property
    def picked(self):
        """The round whose weights are kept, counted from 0."""
        return int(np.argmin([one.error for one in self.history]))

    def epoch(self):
        """Run one `Round`."""
        done = len(self.history) * self.recipe.check
        loss = np.mean([self.step(done + k) for k in range(self.recipe.check)])
        self.history.append(Round(float(loss), self.error()))
        if self.picked == len(self.history) - 1:
            self.best = deepcopy(self.network)

    def step(self, number):
        """Make one step of the optimiser and return its loss."""
        draws = np.random.default_rng((self.recipe.seed, number))
        self.optimiser.param_groups[0]["lr"] = self.recipe.rate(number)
        self.optimiser.zero_grad()
        total = 0.0
        for _ in range(self.recipe.batch):
            loss = self.loss(draws) / self.recipe.batch
            loss.backward()
            total += loss.item()
        if not np.isfinite(total):
            raise Diverged(f"step {number}: the loss is {total}; try smaller rates")
        self.optimiser.step()
        return total

    def loss(self, draws):
        """Return the loss of a random frame with noise on it."""
        run = self.runs[draws.integers(len(self.runs))]
        noise = random_walk(draws, run.frames.shape[1:], self.recipe.noise)
        shown = example(run, int(draws.integers(run.count)), self.reading, noise)
        answers = self.network(shown.points, shown.edges, shown.graph)
        return ((answers - shown.answer) ** 2).sum(dim=1).mean()

    def error(self):
        """Return the mean squared error of free runs from the start [m^2], over frames, points and
        axes; the first frame, which is true, counts.
        """
        return float(np.mean([self.error_along(run) for run in self.runs[:self.recipe.checked]]))

    def error_along(self, run):
        """Return the error of a free run along a `Run`."""
        true = run.frames[HISTORY:]
        frames = free_run(self.answer, self.reading, run.frames[:HISTORY + 1], run.box)
        try:
            error = np.mean([np.mean((x - y) ** 2) for x, y in
                             zip(islice(frames, len(true)), true, strict=True)])
        except SimulatorFailure:
            return np.inf
        return error if np.isfinite(error) else np.inf

    def answer(self, points, edges, graph):
        """Return the answers of the network as it is now; arrays."""
        with torch.no_grad():
            answers = self.network(single(points), single(edges),
                                 Graph(*map(torch.from_numpy, graph)))
        return answers.double().numpy()

    def simulator(self, about):
        """Return the `Simulator` of the best weights, with plain values that describe it.

        Raises `Diverged` where all free runs broke down.
        """
        if not np.isfinite(self.history[self.picked].error):
            raise Diverged(f"all {len(self.history)} free runs broke down; try more steps")
        return Simulator(export_weights(self.best), self.reading, about)

    def states(self):
        """Return the objects with states in a checkpoint: network, best network, optimiser."""
        return {"network": [self.network], "best": [self.best], "optimiser": [self.optimiser]}


def data_digest(runs, dt):
    """Return the sha256 of the training data."""
    digest = hashlib.sha256(repr(dt).encode())
    for run in runs:
        for a in (run.frames, *run.box):
            digest.update(repr(a.shape).encode() + a.tobytes())
    return digest.hexdigest()


def train_graph(recipe, runs, dt, checkpoint=None, on_round=None):
    """Return a `GraphSession`, trained on `Run`s of frames dt [s] apart.

    checkpoint: a file to go on from and to save to; on_round(history) is called after each round.
    Raises `Diverged`, with the step.
    """
    session = GraphSession(recipe, runs, dt)
    return train_epochs(session, recipe.rounds, SAVE, checkpoint, on_round)
