"""Islands of particles: a partition that does not depend on their order."""

import numpy as np
import pytest
from far_bodies import clusters
from hypothesis import given
from hypothesis import strategies as st
from problems import DX
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from threads import by_threads

from mpm_ref.core.block_table import SHIFT
from mpm_ref.core.islands import APART, islands_of, runs_of
from mpm_ref.core.spline import STENCILS
from mpm_ref.plain.spline import pairs


def points(seed, d):
    """Clusters of points, of which some touch."""
    rng = np.random.default_rng(seed)
    return clusters(rng, d, centers=rng.integers(1, 12), n=rng.integers(1, 30),
                    width=rng.choice([10.0, 60.0, 200.0, 1e6]))


def base(x, degree):
    """Base nodes (N, d)."""
    return pairs(x, DX, degree).node[:, 0]


def plain_islands(base):
    """The number of the island of each particle, from the distances of all blocks."""
    blocks, block = np.unique(base >> SHIFT, axis=0, return_inverse=True)
    near = np.abs(blocks[:, None] - blocks[None]).max(axis=2) <= 1
    return connected_components(coo_array(near), directed=False)[1][block.reshape(-1)]


def boxes_of(base, number):
    """The set of the boxes of particles' islands."""
    return {(*base[number == k].min(axis=0), *base[number == k].max(axis=0))
            for k in np.unique(number)}


SEEDS, DEGREES = st.integers(0, 2**32 - 1), st.sampled_from((1, 2, 3))


@given(SEEDS, st.sampled_from((2, 3)), DEGREES)
def test_islands_are_those_of_the_plain_twin(seed, d, degree):
    x = points(seed, d)
    islands = islands_of([x], DX, STENCILS[degree])
    expected = boxes_of(base(x, degree), plain_islands(base(x, degree)))
    assert set(map(tuple, islands.boxes.tolist())) == expected
    assert len(islands.boxes) == len(expected)
    assert set(islands.number) == set(range(len(expected)))


@given(SEEDS, st.sampled_from((2, 3)))
def test_each_block_has_the_box_of_its_particles(seed, d):
    x = points(seed, d)
    node = base(x, 2)
    islands = islands_of([x], DX, STENCILS[2])
    assert set(map(tuple, islands.blocks.tolist())) == boxes_of(
        node, np.unique(node >> SHIFT, axis=0, return_inverse=True)[1].reshape(-1))
    for box, number in zip(islands.blocks, islands.number, strict=True):
        island = islands.boxes[number]
        assert (island[:d] <= box[:d]).all()
        assert (island[d:] >= box[d:]).all()


@given(SEEDS, st.sampled_from((2, 3)), DEGREES)
def test_nodes_of_two_islands_are_far_from_each_other(seed, d, degree):
    """Each pair of nodes that particles of two islands reach is APART along some axis."""
    x = points(seed, d)
    node = pairs(x, DX, degree).node
    number = plain_islands(node[:, 0])
    nodes = [np.unique(node[number == k].reshape(-1, d), axis=0) for k in np.unique(number)]
    for k, a in enumerate(nodes):
        for b in nodes[k + 1 :]:
            assert np.abs(a[:, None] - b[None]).max(axis=2).min() >= APART


@given(SEEDS, st.sampled_from((2, 3)))
def test_islands_do_not_depend_on_the_order_of_particles_nor_on_their_body(seed, d):
    x = points(seed, d)
    rng = np.random.default_rng(seed)
    y = rng.permutation(x)
    cut = rng.integers(1, len(x)) if len(x) > 1 else 0
    one = islands_of([x], DX, STENCILS[2])
    two = islands_of([y[:cut], y[cut:]] if cut else [y], DX, STENCILS[2])
    rows = [sorted(map(tuple, np.hstack([a.blocks, a.boxes[a.number]]).tolist()))
            for a in (one, two)]
    assert rows[0] == rows[1]


def test_particles_in_the_order_of_cells_have_few_runs(d, rng):
    """In 4 x 4 (x 4) blocks full of particles there are as many as lines of blocks and cells."""
    side = 4 * 2**SHIFT
    k = np.arange(2 * side)
    x = (np.stack(np.meshgrid(*d * [k], indexing="ij"), axis=-1).reshape(-1, d) / 2 + 1.25) * DX
    runs = runs_of(x, DX, STENCILS[2])
    assert len(runs) <= (2 * side) ** (d - 1) * 6
    assert len(np.unique(runs[:, :d] >> SHIFT, axis=0)) == 5**d


@pytest.mark.parametrize("degree", [2])
def test_same_islands_for_any_number_of_threads(d, degree, rng):
    x = clusters(rng, d)
    one, two = by_threads(lambda: islands_of([x], DX, STENCILS[degree]))
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a, b)
