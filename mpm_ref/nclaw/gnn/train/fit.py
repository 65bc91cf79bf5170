"""Training of a graph network: steps, free runs that pick the weights, checkpoints [GNS].

A round of the training is `GraphRecipe.check` steps and a free run. What is drawn in a step follows
from the seed and the step's number alone, so that a training that is cut off goes on from its last
checkpoint with the numbers of one that was not, on the same machine with the same threads.
"""

import hashlib
import io
import json
from copy import deepcopy
from dataclasses import asdict
from itertools import islice
from typing import NamedTuple

import numpy as np
import torch

from ....store import weights_file
from ....training import Cost, Meter, train_epochs
from ...train.fit import Diverged
from ..graph import Graph, Lost
from ..history import HISTORY, Reading
from ..simulator import Simulator, free_run
from .examples import example, scales_of, single, walk
from .network import GraphNetwork, exported

SAVE = 1            # rounds between checkpoints
FORMAT = 1          # of checkpoints


class Round(NamedTuple):
    """What a round was like."""

    loss: float         # the mean over its steps
    error: float        # mean squared, of free runs [m^2]; infinite where they break down


class GraphSession:
    """Network and optimiser of a training under way."""

    def __init__(self, recipe, runs, dt):
        self.meter = Meter()
        self.recipe, self.runs = recipe, runs
        self.reading = Reading(recipe.radius, dt, scales_of(runs, recipe.noise))
        self.of = sha256(runs, dt)
        torch.manual_seed(recipe.seed)
        self.network = GraphNetwork(runs[0].frames.shape[-1], recipe.width, recipe.blocks)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=recipe.first_rate)
        self.best = copied(self.network)
        self.history = []

    @property
    def named(self):
        """The training's settings and on what it is, as one line of text."""
        return json.dumps({"format": FORMAT, **asdict(self.recipe), "data": self.of})

    @property
    def picked(self):
        """The round whose weights are kept, counted from 0."""
        return int(np.argmin([one.error for one in self.history]))

    def epoch(self):
        """One `Round`."""
        done = len(self.history) * self.recipe.check
        loss = np.mean([self.step(done + k) for k in range(self.recipe.check)])
        self.history.append(Round(float(loss), self.error()))
        if self.picked == len(self.history) - 1:
            self.best = copied(self.network)

    def step(self, number):
        """One step of the optimiser; returns its loss."""
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
        """The loss of a random frame with noise on it."""
        run = self.runs[draws.integers(len(self.runs))]
        noise = walk(draws, run.frames.shape[1:], self.recipe.noise)
        shown = example(run, int(draws.integers(run.count)), self.reading, noise)
        found = self.network(shown.points, shown.edges, shown.graph)
        return ((found - shown.answer) ** 2).sum(dim=1).mean()

    def error(self):
        """Mean squared error of free runs from the start [m^2], over frames, points and axes; the
        first frame, which is true, counts.
        """
        return float(np.mean([self.error_along(run) for run in self.runs[:self.recipe.checked]]))

    def error_along(self, run):
        """The error of a free run along a `Run`."""
        true = run.frames[HISTORY:]
        found = free_run(self.answer, self.reading, run.frames[:HISTORY + 1], run.box)
        try:
            error = np.mean([np.mean((x - y) ** 2) for x, y in
                             zip(islice(found, len(true)), true, strict=True)])
        except Lost:
            return np.inf
        return error if np.isfinite(error) else np.inf

    def answer(self, points, edges, graph):
        """Answers of the network as it is now; arrays."""
        with torch.no_grad():
            found = self.network(single(points), single(edges),
                                 Graph(*map(torch.from_numpy, graph)))
        return found.double().numpy()

    def simulator(self, about):
        """`Simulator` of the weights that were picked, with plain values that are known of it.

        Raises `Diverged` where all free runs broke down.
        """
        if not np.isfinite(self.history[self.picked].error):
            raise Diverged(f"all {len(self.history)} free runs broke down; try more steps")
        picked = deepcopy(self.network)
        picked.load_state_dict(self.best)
        return Simulator(exported(picked), self.reading, about)

    def save(self, path):
        """Checkpoint, whole or not at all."""
        content = io.BytesIO()
        torch.save({"training": self.named, "history": [tuple(one) for one in self.history],
                    "network": self.network.state_dict(), "best": self.best,
                    "optimiser": self.optimiser.state_dict(), "cost": tuple(self.meter.total)},
                   content)
        weights_file.write_sealed(path, content.getvalue())

    def load(self, path):
        """Go on from a checkpoint. Raises ValueError where it is damaged, or of another training or
        other data.
        """
        kept = torch.load(io.BytesIO(weights_file.read_sealed(path)), weights_only=True)
        weights_file.require_same_training(path, kept["training"], self.named)
        self.network.load_state_dict(kept["network"])
        self.optimiser.load_state_dict(kept["optimiser"])
        self.best, self.history = kept["best"], [Round(*row) for row in kept["history"]]
        self.meter.before = Cost(*kept["cost"])


def copied(network):
    """The weights of a network as they are now, by name."""
    return {name: a.clone() for name, a in network.state_dict().items()}


def sha256(runs, dt):
    """Digest of all that is trained on."""
    digest = hashlib.sha256(repr(dt).encode())
    for run in runs:
        for a in (run.frames, *run.box):
            digest.update(repr(a.shape).encode() + a.tobytes())
    return digest.hexdigest()


def train(recipe, runs, dt, checkpoint=None, on_round=None):
    """A `GraphSession`, trained on `Run`s of frames dt [s] apart.

    checkpoint: a file to go on from and to save to; on_round(history) is called after each round.
    Raises `Diverged`, with the step.
    """
    session = GraphSession(recipe, runs, dt)
    return train_epochs(session, recipe.rounds, SAVE, checkpoint, on_round)
