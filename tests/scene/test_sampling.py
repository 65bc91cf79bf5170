import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mpm_ref import shapes
from mpm_ref.sampling import Jittered, Lattice, Poisson, Regular, poisson_count, sample
from mpm_ref.sampling.poisson import MAX_CELLS, poisson_disk
from mpm_ref.shapes.inside import solid

CUBE = solid(shapes.Box(lower=(0.25, 0.25, 0.25), upper=(0.75, 0.75, 0.75)))
SQUARE = solid(shapes.Box(lower=(0.0, 0.0), upper=(1.0, 1.0)))
DISK = solid(shapes.Sphere(center=(0.52, 0.47), radius=0.3))
LDM = solid(shapes.Cylinder(start=(0.0, 0.0, 0.0), end=(0.4, 0.0, 0.0), radius=0.1))


def nearest(x):
    return cKDTree(x).query(x, k=2)[0][:, 1]


# lattices

def test_regular_points_are_centres_of_sub_cells():
    x, V0 = sample(Regular(per_cell=2), SQUARE, 0.25, 0)
    assert len(x) == (4 * 2) ** 2
    offsets = x / 0.125 - np.floor(x / 0.125)
    assert np.allclose(offsets, 0.5, atol=1e-12)
    assert np.allclose(V0, 1.0 / 64.0, rtol=1e-14)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_regular_fills_every_cell_with_k_to_the_d(k):
    x, _ = sample(Regular(per_cell=k), CUBE, 0.125, 0)
    cells, counts = np.unique(np.floor(x / 0.125), axis=0, return_counts=True)
    assert len(cells) == 4**3
    assert (counts == k**3).all()


def test_regular_points_are_aligned_to_the_grid_not_to_the_shape():
    moved = solid(shapes.Box(lower=(0.01, 0.02), upper=(1.01, 1.02)))
    x, _ = sample(Regular(per_cell=2), moved, 0.25, 0)
    assert np.allclose(x / 0.125 - np.floor(x / 0.125), 0.5, atol=1e-12)


@pytest.mark.parametrize("sampling", [
    Regular(per_cell=3), Jittered(per_cell=3), Lattice(spacing=0.02), Lattice(counts=(20, 20)),
    Poisson(radius=0.03), Poisson(count=100), Poisson(per_cell=2),
], ids=repr)
def test_volumes_sum_to_that_of_the_shape_and_points_are_inside(sampling):
    x, V0 = sample(sampling, DISK, 0.05, 0)
    assert V0.sum() == pytest.approx(np.pi * 0.3**2, rel=1e-12)
    assert (np.linalg.norm(x - (0.52, 0.47), axis=1) <= 0.3 + 1e-9).all()
    assert x.flags.c_contiguous


def test_volume_of_the_cell():
    assert sample(Regular(per_cell=2, volume="cell"), DISK, 0.1, 0).V0[0] == 0.05**2
    assert sample(Jittered(per_cell=2, volume="cell"), CUBE, 0.1, 0).V0[0] == 0.05**3
    spaced = sample(Lattice(spacing=0.03, volume="cell"), DISK, 0.1, 0)
    assert spaced.V0[0] == pytest.approx(0.03**2, rel=1e-14)
    counted = sample(Lattice(counts=(10, 20), volume="cell"), DISK, 0.1, 0)
    assert counted.V0[0] == pytest.approx(0.06 * 0.03, rel=1e-14)


def test_lattice_with_faces_is_the_training_cube_of_nclaw():
    x, V0 = sample(Lattice(counts=(10, 10, 10), faces=True), CUBE, 0.05, 0)
    axis = np.linspace(-0.25, 0.25, 10)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    assert np.array_equal(x, grid + 0.5)
    assert (V0 == 0.125 / 1000).all()


def test_lattice_without_faces_stands_half_a_step_inside():
    x, _ = sample(Lattice(counts=(4, 5)), SQUARE, 1.0, 0)
    assert np.allclose(np.unique(x[:, 0]), [0.125, 0.375, 0.625, 0.875])
    assert np.allclose(np.unique(x[:, 1]), [0.1, 0.3, 0.5, 0.7, 0.9])


def test_lattice_by_spacing_is_centred():
    x, _ = sample(Lattice(spacing=0.3), SQUARE, 1.0, 0)
    assert np.allclose(np.unique(x[:, 0]), [0.2, 0.5, 0.8])
    small = solid(shapes.Box(lower=(0.0, 0.0), upper=(0.6, 0.6)))
    assert len(sample(Lattice(spacing=0.2), small, 1.0, 0).x) == 9    # though 0.6/0.2 < 3


def test_jittered_points_keep_to_their_sub_cells(rng):
    x, _ = sample(Jittered(per_cell=2, amplitude=0.5), SQUARE, 0.25, 3)
    offsets = x / 0.125 - np.floor(x / 0.125)
    assert (np.abs(offsets - 0.5) <= 0.25 + 1e-12).all()
    assert np.abs(offsets - 0.5).max() > 0.2
    assert len(x) == 64
    same = sample(Jittered(per_cell=2, amplitude=0.5), SQUARE, 0.25, 3)
    other = sample(Jittered(per_cell=2, amplitude=0.5), SQUARE, 0.25, 4)
    own = sample(Jittered(per_cell=2, amplitude=0.5, seed=3), SQUARE, 0.25, 4)
    assert np.array_equal(x, same.x)
    assert np.array_equal(x, own.x)
    assert not np.array_equal(x, other.x)
    still = sample(Jittered(per_cell=2, amplitude=0.0), SQUARE, 0.25, 3)
    assert np.array_equal(still.x, sample(Regular(per_cell=2), SQUARE, 0.25, 0).x)


# Poisson-disk points

@pytest.mark.parametrize(("d", "r"), [(2, 0.02), (3, 0.08)])
def test_no_two_points_are_nearer_than_the_radius(d, r):
    x = poisson_disk(np.zeros(d), np.ones(d), r, np.random.default_rng(0))
    assert nearest(x).min() >= r * (1.0 - 1e-12)
    assert nearest(x).min() < 1.01 * r          # and the radius is used
    assert ((x >= 0.0) & (x <= 1.0)).all()


@pytest.mark.parametrize(("d", "r"), [(2, 0.02), (3, 0.08)])
def test_there_is_hardly_room_for_another_point(d, r, rng):
    x = poisson_disk(np.zeros(d), np.ones(d), r, np.random.default_rng(0))
    holes, _ = cKDTree(x).query(rng.uniform(size=(20_000, d)))
    # 30 darts around each point miss some room: 0.1 percent of the square, 0.3 of the cube
    assert (holes > r).mean() < 0.01
    assert holes.max() < 1.3 * r


def test_poisson_points_depend_on_the_seed_alone():
    first, again, other = (poisson_disk((0, 0), (1, 2), 0.05, np.random.default_rng(seed))
                           for seed in (7, 7, 8))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:5], other[:5])


def test_box_may_stand_anywhere():
    x = poisson_disk((-3.0, 5.0), (-2.0, 5.5), 0.05, np.random.default_rng(0))
    assert ((x >= (-3.0, 5.0)) & (x <= (-2.0, 5.5))).all()
    assert len(x) > 100


def test_box_smaller_than_the_radius_holds_one_point():
    assert len(poisson_disk((0, 0, 0), (0.1, 0.1, 0.1), 5.0, np.random.default_rng(0))) == 1


@pytest.mark.parametrize("count", [1, 2, 7, 100, 3000])
def test_count_is_met_exactly(count):
    x = poisson_count(DISK, count, 0)
    assert len(x) == count
    assert np.array_equal(x, poisson_count(DISK, count, 0))


def test_count_keeps_the_points_apart_and_everywhere(rng):
    x = poisson_count(LDM, 1368, 0)
    typical = (LDM.volume / 1368) ** (1.0 / 3.0)
    assert nearest(x).min() > 0.7 * typical
    inside = LDM.low + rng.uniform(size=(20_000, 3)) * (LDM.high - LDM.low)
    holes, _ = cKDTree(x).query(inside[LDM.inside(inside)])
    assert holes.max() < 1.5 * typical


def test_ldm_fill_gives_the_printed_number_of_points():
    # LDM-tab2-sampling: 0.87 of 2^3 points per cell; printed are 1368 points
    n = len(sample(Poisson(per_cell=2), LDM, 0.04, 0).x)
    assert n == round(0.87 * 8 * LDM.volume / 0.04**3)
    assert abs(n - 1368) <= 1


def test_same_points_without_the_compiler():
    code = ("import numpy as np, sys\n"
            "from mpm_ref.sampling.poisson import poisson_disk\n"
            "for d, r in ((2, 0.2), (3, 0.4)):\n"
            "    x = poisson_disk(np.zeros(d), np.ones(d), r, np.random.default_rng(1))\n"
            "    sys.stdout.buffer.write(x.tobytes())\n")
    plain = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True,
                           env={**os.environ, "NUMBA_DISABLE_JIT": "1"}).stdout
    compiled = b"".join(
        poisson_disk(np.zeros(d), np.ones(d), r, np.random.default_rng(1)).tobytes()
        for d, r in ((2, 0.2), (3, 0.4)))
    assert len(compiled) > 100
    assert hashlib.sha256(plain).hexdigest() == hashlib.sha256(compiled).hexdigest()


# what cannot be

@pytest.mark.parametrize(("record", "fields", "said"), [
    (Lattice, {}, "one of the two"),
    (Lattice, {"counts": (2, 2), "spacing": 0.1}, "one of the two"),
    (Lattice, {"spacing": 0.1, "faces": True}, "`faces` needs"),
    (Lattice, {"counts": (1, 2), "faces": True}, "at least 2"),
    (Poisson, {}, "one of the three"),
    (Poisson, {"radius": 0.1, "count": 5}, "one of the three"),
])
def test_contradictory_records_are_refused(record, fields, said):
    with pytest.raises(ValueError, match=said):
        record(**fields)


@pytest.mark.parametrize(("sampling", "shape", "said"), [
    (Lattice(counts=(3, 3, 3)), SQUARE, "expected 2 numbers"),
    (Regular(per_cell=1), solid(shapes.Sphere(center=(0.0, 0.0), radius=0.1)), "no sample point"),
    (Regular(per_cell=64), solid(shapes.Box(lower=(0.0, 0.0), upper=(1e6, 1e6))), "coarser"),
    (Lattice(counts=(10**6, 10**6)), SQUARE, "coarser"),
    (Poisson(radius=1e-6), SQUARE, "larger radius"),
    (Poisson(per_cell=1, fill=0.01), SQUARE, "less than one point"),
    (Regular(), solid(shapes.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0))), "has no end"),
])
def test_impossible_samplings_are_refused(sampling, shape, said):
    with pytest.raises(ValueError, match=said):
        sample(sampling, shape, 1.0, 0)


def test_radius_must_be_positive():
    with pytest.raises(ValueError, match="expected a distance > 0"):
        poisson_disk((0, 0), (1, 1), 0.0, np.random.default_rng(0))


def test_limit_on_cells_counts_the_cells_of_the_box():
    r = np.sqrt(2.0 / (1.5 * MAX_CELLS))
    with pytest.raises(ValueError, match="larger radius"):
        poisson_disk((0, 0), (1, 1), r, np.random.default_rng(0))
