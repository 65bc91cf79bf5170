"""The graph network [GNS] in NumPy: encoder, message passing, decoder.

    v_i = points(a_i),    e_ij = edges(b_ij)
    m_ij = edges_k(e_ij, v_j, v_i),   w_i = points_k(v_i, sum_j m_ij),   e += m,   v += w
    y_i = answer(v_i)

for blocks k = 0, 1, ..; edge ij is from j to i. Each name is a perceptron of its own: affine maps
with max(z, 0) between them, and all but the last one have their outputs normalised (`normalised`).
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

TINY = 1e-5         # added to the variance of outputs
PART = 2048         # edges at a time, at least: their features stay in the processor's cache


class PerceptronWeights(NamedTuple):
    """Affine maps, and the scales of the outputs after normalisation."""

    layers: tuple       # ((W (in, out), b (out,)), ..)
    norm: tuple = ()    # gain and shift (out,); none: no normalisation


class GraphWeights(NamedTuple):
    """The weights of all perceptrons of a graph network."""

    points: PerceptronWeights
    edges: PerceptronWeights
    blocks: tuple       # of (edges_k, points_k)
    answer: PerceptronWeights


def answers(net, points, edges, graph):
    """Return the outputs (n, d) of a network of `GraphWeights` for features of points (n, ..) and
    of edges (k, ..).
    """
    v, e = outputs(net.points, points), outputs(net.edges, edges)
    ends = np.linspace(0, len(e), max(len(e) // PART, 1) + 1).astype(int)
    parts = [slice(*part) for part in pairwise(ends)]
    for of_edges, of_points in net.blocks:
        m = np.concatenate([outputs(of_edges, np.hstack([
            e[part], v[graph.senders[part]], v[graph.receivers[part]]])) for part in parts])
        w = outputs(of_points, np.hstack([v, np.add.reduceat(m, graph.first)]))
        v, e = v + w, e + m
    return outputs(net.answer, v)


def outputs(perceptron, a):
    """Return the outputs of a perceptron at inputs (n, in)."""
    *inner, (W, b) = perceptron.layers
    for V, c in inner:
        a = np.maximum(a @ V + c, 0.0)
    a = a @ W + b
    return normalised(a, *perceptron.norm) if perceptron.norm else a


def normalised(a, gain, shift):
    """Return the rows without their mean over their deviation, times a gain, and a shift."""
    a = a - a.mean(axis=1, keepdims=True)
    return a / np.sqrt((a**2).mean(axis=1, keepdims=True) + TINY) * gain + shift
