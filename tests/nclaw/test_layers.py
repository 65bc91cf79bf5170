"""Layers of trained networks: the bits of plain sums, in single close to those in double."""

from itertools import pairwise
from math import erf

import admissible_toys
import neural_toys
import numpy as np
import pytest
from neural_toys import CORRECTIONS, STRESSES, UNIT, deformations, trained
from numba.core.errors import TypingError
from numba.core.runtime import _nrt_python, rtsys
from problems import DX, run_python, stepped
from problems import digest as digest_of
from scipy.special import erf as erfs
from small_runs import block
from variants import slow_but

from mpm_ref.core.jit import kernel
from mpm_ref.core.lanes import lanes, put_lanes
from mpm_ref.core.tensor import mat, put_mat
from mpm_ref.explicit import Scheme, deform_body
from mpm_ref.materials.learned import layers, learned_flow, learned_law, network, weights
from mpm_ref.materials.learned.guard import cut, guarded, strain_box
from mpm_ref.nclaw.bodies import material_points
from mpm_ref.problem import Clock, Problem
from mpm_ref.scene import SceneError, build, canonical, load
from mpm_ref.timestep import moduli

EPS = float(np.finfo(np.float32).eps)       # a rounding in single errs by half of it
SINGLE = 8.0 * EPS      # of the largest answer: roundings of 64 products, at random, twice
BOX = {2: {"low": [0.9, 0.7, 0.65], "high": [1.4, 1.05, 1.3]},
       3: {"low": [0.9, 0.8, 0.7, 0.6], "high": [1.4, 1.1, 1.05, 1.3]}}
SHAPES = {"as printed": ((64, 64), 0.0), "biases": ((7, 12, 5), 0.3), "no hidden layer": ((), 0.1)}
WIDTHS = [(13, 64, 64, 9), (7, 64, 64, 4), (13, 9), (3, 7, 12, 5, 2), (9, 8, 16, 31, 32, 33, 9),
          (13, 40, layers.WIDTH, 100, 9), (13, layers.WIDTH + 1, 20, 9)]

DIGEST = """
import json, numba
from tests.nclaw.test_layers import falling
from problems import digest, stepped
print(json.dumps([digest(stepped(falling(), 3)), numba.get_num_threads()]))
"""

SCENE = """
dim = {dim}
dx = 0.05
dt = 1e-3
steps = 1
[[body]]
name = "b"
density = 1000.0
shape = {{ type = "box", lower = {lower}, upper = {upper} }}
material = {{ {material} }}
"""


@kernel
def gelu(z):
    return 0.5 * z * (1.0 + erf(layers.ROOT * z))


@kernel
def plain_outputs(a, sizes, W, b):
    """`layers.outputs` as it reads: each layer adds the rows of W, one after the other."""
    w, k, last = 0, 0, len(sizes) - 1
    for l in range(last):
        n, m = sizes[l], sizes[l + 1]
        z = b[k:k + m].copy()
        for i in range(n):
            for j in range(m):
                z[j] += a[i] * W[w + i * m + j]
        if l < last - 1:
            for j in range(m):
                z[j] = gelu(z[j])
        a, w, k = z, w + n * m, k + m
    return a


@kernel
def all_stresses(F, law, tau, like):
    for p in range(len(F)):
        put_mat(tau, p, network.kirchhoff(mat(F, p, like), law))


def nested(F):
    """F as kernels take it."""
    return tuple(map(tuple, F.tolist()))


def net_of(sizes, seed=0):
    """sizes, W, b of a random network."""
    rng = np.random.default_rng(seed)
    return network.flatten([(rng.normal(size=(n, m)) / np.sqrt(n), rng.normal(size=m))
                            for n, m in pairwise(sizes)])


def deployed(of, precision="double"):
    """Record and its function, of `LawWeights`."""
    if type(of.kind) in STRESSES:
        return learned_law(of, precision), network.kirchhoff
    return learned_flow(of, precision), network.returned


def answers(of, F, precision="double"):
    law, function = deployed(of, precision)
    return np.array([function(nested(one), law) for one in F])


def points(F, precision):
    laws = neural_toys.laws(F.shape[1])
    return material_points(learned_law(laws.elastic, precision),
                           learned_flow(laws.plastic, precision), F)


def falling():
    """A block of a law in single that hits the nodes of a classical one."""
    made, left = neural_toys.laws(2), block("left", (0.3, 0.5), (0.0, 0.0))
    left = left._replace(law=learned_law(made.elastic, "single"),
                         flow=learned_flow(made.plastic, "single"))
    right = block("right", (0.5, 0.5), (-1.0, 0.0))
    return Problem((left, right), DX, Clock(dt=1e-3, steps=10, every=5), np.zeros(2), Scheme())


# in double

@pytest.mark.parametrize("sizes", WIDTHS, ids=str)
def test_sums_in_registers_have_the_bits_of_plain_sums(sizes):
    net = net_of(sizes)
    for a in np.random.default_rng(1).normal(size=(20, sizes[0])):
        room = np.full(max(sizes[0], sizes[-1]) + 1, 7.0)
        room[:sizes[0]] = a
        layers.outputs(room, *net)
        expected = plain_outputs(a, *net)
        assert np.array_equal(room[:sizes[-1]], expected)
        assert room[-1] == 7.0


@pytest.mark.parametrize("sizes", [(9, 9, 9), (40, 40, 40), (9, 40, 33, 9)], ids=str)
def test_nothing_is_written_beyond_the_room(sizes):
    net, room = net_of(sizes), np.full(2 * max(sizes) + 64, 7.0)
    layers.pass_through(np.ones(sizes[0]), *net, room[:-64])
    assert (room[-64:] == 7.0).all()
    assert (room[:-64] != 7.0).any()


def test_what_is_not_finite_stays_so():
    net = net_of((13, 64, 64, 9))
    for single in (False, True):
        W, b = (one.astype(np.float32) if single else one for one in net[1:])
        a = np.zeros(13)
        a[3] = np.nan
        layers.outputs(a, net[0], W, b)
        assert np.isnan(a[:9]).all()


@pytest.mark.parametrize("precision", ["double", "single"])
def test_points_allocate_nothing(d, precision):
    law, F = learned_law(trained(neural_toys.response.Stress(), d), precision), deformations(d)
    tau = np.empty_like(F)
    all_stresses(F, guarded(law, strain_box(BOX[d])), tau, tuple(range(d)))
    _nrt_python.memsys_enable_stats()
    try:
        before = rtsys.get_allocation_stats().alloc
        all_stresses(F, guarded(law, strain_box(BOX[d])), tau, tuple(range(d)))
        assert rtsys.get_allocation_stats().alloc - before < len(F)
    finally:
        _nrt_python.memsys_disable_stats()


# in single

def test_gelu_in_single():
    z = np.linspace(-60.0, 60.0, 100_001).astype(np.float32)
    exact, found = 0.5 * z * (1.0 + erfs(z.astype(float) / np.sqrt(2.0))), z.copy()
    layers.activate(found)
    assert found.dtype == np.float32
    assert (abs(found - exact) <= 2.5 * EPS * abs(z)).all()


def test_the_fit_of_gelu():
    x = np.linspace(0.0, layers.FAR, 10_001)
    over, under = (np.polynomial.polynomial.polyval(x * x, c) for c in (layers.P, layers.Q))
    assert abs(x * over / under - 0.5 * erfs(x / np.sqrt(2.0))).max() <= 8e-9


@pytest.mark.parametrize("kind", slow_but((*STRESSES, *CORRECTIONS), STRESSES[0], CORRECTIONS[0]),
                         ids=lambda kind: kind.__name__)
@pytest.mark.parametrize(("hidden", "bias"), SHAPES.values(), ids=SHAPES)
def test_answers_in_single_are_close_to_those_in_double(d, kind, hidden, bias):
    of, F = trained(kind(**{kind._fields[0]: 0.7}), d, hidden, bias), deformations(d)
    double, single = answers(of, F), answers(of, F, "single")
    size = abs(double - F if kind in CORRECTIONS else double).max()
    assert 0.0 < abs(single - double).max() <= SINGLE * size


def test_a_law_without_rotation_reads_all_of_F_in_single(d):
    rng = np.random.default_rng(0)
    W = rng.normal(size=(d * d, d * d))
    of = weights.LawWeights(((W, np.zeros(d * d)),), neural_toys.response.PlainStress())
    F = deformations(d)
    expected = ((F - np.eye(d)).reshape(-1, d * d) @ W).reshape(F.shape) @ F.swapaxes(1, 2)
    found = answers(of, F, "single")
    assert 0.0 < abs(found - expected).max() <= 2 * d * d * EPS * abs(expected).max()


def test_a_step_computes_its_layers_in_single(d):
    F = deformations(d)
    body, double = points(F, "single"), points(F, "double")
    for one in (body, double):
        one.particles.L[:] = np.random.default_rng(1).normal(size=F.shape)
        deform_body(one, 0.1)
    q = body.particles
    assert q.F.dtype == q.tau.dtype == float
    assert np.array_equal(q.tau, answers(neural_toys.laws(d).elastic, q.F, "single"))
    assert not np.array_equal(q.tau, answers(neural_toys.laws(d).elastic, q.F))
    assert abs(q.tau - double.particles.tau).max() <= 1e-5 * abs(double.particles.tau).max()


def test_the_stable_step_does_not_depend_on_the_precision(d):
    F = deformations(d)
    for one, other in zip(moduli(points(F, "single")), moduli(points(F, "double")), strict=True):
        assert np.array_equal(one, other)


def test_the_guard_cuts_the_same_strains(d):
    of, box, kept = trained(neural_toys.response.Stress(UNIT), d), strain_box(BOX[d]), 0
    law, _ = deployed(of, "single")
    for F in map(nested, deformations(d, n=60)):
        F_cut, is_cut = cut(F, box.low, box.high)
        found = network.kirchhoff(F, guarded(law, box))
        assert found == network.kirchhoff(F_cut, law)
        kept += not is_cut
    assert 0 < kept < 60


def test_bits_do_not_depend_on_threads():
    own = digest_of(stepped(falling(), 3))
    for threads in ("1", "2"):
        assert run_python(DIGEST, NUMBA_NUM_THREADS=threads, MPM_REF_FEW_ITEMS="0") == [
            own, int(threads)]


# the choice

def test_an_unknown_precision_is_refused():
    laws = neural_toys.laws(2)
    with pytest.raises(ValueError, match="precision = 'half': expected double or single"):
        learned_law(laws.elastic, "half")
    with pytest.raises(ValueError, match="precision = 'half': expected double or single"):
        learned_flow(laws.plastic, "half")


def test_laws_that_have_no_single_precision_are_refused():
    with pytest.raises(ValueError, match="kind Energetic compute in double alone"):
        learned_law(admissible_toys.energetic(), "single")
    with pytest.raises(ValueError, match="kind Contraction compute in double alone"):
        learned_flow(admissible_toys.contraction(), "single")


@pytest.mark.parametrize(("shapes", "biases"), [
    ([(13, 5), (5, 17)], (5, 17)), ([(18, 5), (5, 9)], (5, 9)), ([(13, 5), (6, 9)], (5, 9)),
    ([(13, 5), (5, 9)], (5, 8)), ([(7, 5), (5, 9)], (5, 9)), ([(13,)], (9,)), ([], ())])
def test_layers_that_do_not_fit_are_refused(shapes, biases):
    """Kernels read and write as many numbers as sizes say."""
    given = [(np.zeros(shape), np.zeros(m)) for shape, m in zip(shapes, biases)]
    for deploy, kind in ((learned_law, STRESSES[0]()), (learned_flow, CORRECTIONS[0]())):
        with pytest.raises(ValueError, match="expected each to fit the next, the first to read 7"):
            deploy(weights.LawWeights(tuple(given), kind))


@kernel
def first_lanes(a):
    put_lanes(a, 0, lanes(a, 0, 8))


@kernel
def lanes_of_other_numbers(a, b):
    put_lanes(b, 0, lanes(a, 0, 8))


def test_lanes_are_of_contiguous_arrays_of_one_type():
    first_lanes(np.zeros(8))
    with pytest.raises(TypingError, match="expected a contiguous array"):
        first_lanes(np.zeros(16)[::2])
    with pytest.raises(TypingError, match="expected a contiguous array of float64"):
        lanes_of_other_numbers(np.zeros(8), np.zeros(8, np.float32))


def scene_of(folder, material, dim=2):
    path = folder / "scene.toml"
    path.write_text(SCENE.format(dim=dim, lower=[0.3] * dim, upper=[0.5] * dim, material=material))
    return path


def test_a_scene_chooses(tmp_path):
    weights.save(tmp_path / "laws.npz", neural_toys.laws(2))
    plain = 'law = "neural", weights = "laws.npz"'
    body, = build(load(scene_of(tmp_path, f'{plain}, precision = "single"'))).bodies
    assert body.law.W.dtype == body.law.b.dtype == np.float32
    assert body.flow.W.dtype == body.flow.b.dtype == np.float32
    chosen, = build(load(scene_of(tmp_path, f'{plain}, precision = "double"'))).bodies
    assert chosen.law.W.dtype == chosen.flow.W.dtype == float
    assert canonical(load(scene_of(tmp_path, f'{plain}, precision = "double"'))) == canonical(
        load(scene_of(tmp_path, plain)))


@pytest.mark.parametrize(("material", "said"), [
    ('law = "neural", weights = "laws.npz", precision = "half"', "precision.*'half'"),
    ('law = "hencky", E = 1e5, nu = 0.3, precision = "single"',
     "precision = 'single': expected with the law 'neural' alone"),
    ('law = "neural", weights = "energy.npz", precision = "single"',
     "laws of kind Energetic compute in double alone")])
def test_what_a_scene_gets_wrong_is_said(tmp_path, material, said):
    weights.save(tmp_path / "laws.npz", neural_toys.laws(3))
    weights.save(tmp_path / "energy.npz", admissible_toys.laws())
    with pytest.raises(SceneError, match=said):
        load(scene_of(tmp_path, material, dim=3))
