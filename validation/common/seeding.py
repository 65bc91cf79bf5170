"""The random numbers of an experiment."""

import zlib

import numpy as np


def generator(seed, experiment_id):
    """Return the generator of an experiment for a seed; each experiment has numbers of its own."""
    return np.random.default_rng([seed, zlib.crc32(experiment_id.encode())])
