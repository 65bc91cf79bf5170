"""Small systems with the interface of `mpm_ref.hot.system.System`, for tests of the solvers.

`lattice` is a body in miniature: nodes with masses, springs that do not care for the sign of
their stretch beyond the length, held nodes and nodes that slip along an oblique plane.
"""

from contextlib import nullcontext

import numpy as np
from scipy.sparse import bsr_array

from mpm_ref.hot import linearization
from mpm_ref.hot.methods import METHODS, options_of

DESCENTS = sorted(word for word, options in METHODS.items() if options.descent != "admm")
DT, EDGE = 0.1, 1.0


class Toy:
    """A system from E(dv), dE(dv) and H(dv), dense (n, d), and (n, d, n, d)."""

    def __init__(self, functions, start, kappa=None, B=None):
        n, d = start.shape
        self.functions, self.start, self.n = functions, start, n
        self.kappa = np.ones(n) if kappa is None else kappa
        self.B = np.tile(np.eye(d), (n, 1, 1)) if B is None else B
        self.index = np.stack([np.arange(n)] + [np.zeros(n, int)] * (d - 1), axis=1)
        self.calls = {"energy": 0, "evaluate": 0, "matrix": 0, "product": 0, "diagonal": 0}
        self.visited = []       # (dv, E) of every evaluation

    def energy(self, dv):
        self.calls["energy"] += 1
        return self._energy(dv)

    def _energy(self, dv):
        E = float(self.functions[0](dv))
        self.visited.append((dv.copy(), E))
        return E

    def evaluate(self, dv):
        self.calls["evaluate"] += 1
        return self._energy(dv), self.project(self.functions[1](dv))

    def project(self, u):
        return np.einsum("nab,nb->na", self.B, u)

    def balanced(self, dv):
        return dv

    def dense(self, dv):
        return np.einsum("nab,nbmc,mcd->namd", self.B, self.functions[2](dv), self.B)

    def matrix(self, dv):
        self.calls["matrix"] += 1
        n, d = dv.shape
        H = self.dense(dv)
        full = bsr_array(H.reshape(n * d, n * d), blocksize=(d, d))
        return with_diagonal(full, n, d)

    def matrices(self, dv, levels):
        return [(self.matrix(dv), self.index)]

    def product(self, dv, projected=True):
        self.calls["product"] += 1
        H = self.dense(dv)
        return lambda u: np.einsum("namb,mb->na", H, u)

    def diagonal(self, dv):
        self.calls["diagonal"] += 1
        return np.einsum("nanb->nab", self.dense(dv)).copy()


def with_diagonal(A, n, d):
    """A with a block on the diagonal of every row, zero where it had none."""
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    there = set(zip(row.tolist(), A.indices.tolist()))
    blocks = {(i, i): np.zeros((d, d)) for i in range(n)}
    blocks |= {key: A.data[k] for k, key in enumerate(zip(row.tolist(), A.indices.tolist()))}
    keys = sorted(set(blocks) | there)
    indptr = np.searchsorted([i for i, _ in keys], np.arange(n + 1)).astype(np.int32)
    indices = np.array([j for _, j in keys], dtype=np.int32)
    return bsr_array((np.array([blocks[key] for key in keys]), indices, indptr),
                     shape=(n * d, n * d))


def quadratic(H, b, **more):
    """E = x.H x / 2 - b.x for H (n, d, n, d) and b (n, d)."""
    def product(x):
        return np.einsum("namb,mb->na", H, x)
    functions = (lambda x: 0.5 * np.sum(x * product(x)) - np.sum(b * x),
                 lambda x: product(x) - b, lambda x: H)
    return Toy(functions, np.zeros_like(b), **more)


def random_quadratic(rng, n=5, d=2, decades=3):
    """A quadratic whose Hessian has eigenvalues over the given decades."""
    Q = np.linalg.qr(rng.standard_normal((n * d, n * d)))[0]
    H = (Q * np.geomspace(1.0, 10.0**decades, n * d)) @ Q.T
    H = 0.5 * (H + H.T)
    return quadratic(H.reshape(n, d, n, d), rng.standard_normal((n, d)))


def scalar(E, dE, ddE, start=0.0):
    """A system of one unknown."""
    functions = (lambda x: E(x[0, 0]), lambda x: np.array([[dE(x[0, 0])]]),
                 lambda x: np.array([[[[ddE(x[0, 0])]]]]))
    return Toy(functions, np.array([[float(start)]]))


class Springs:
    """e = k L^2/8 (|r|^2/L^2 - 1)^2 on every edge; nodes at x = x0 + dt (v + dv)."""

    def __init__(self, nodes, m, k, v):
        self.x0, self.m, self.v = nodes.astype(float) * EDGE, m, v
        i, j = np.triu_indices(len(nodes), 1)
        near = np.abs(nodes[i] - nodes[j]).max(axis=1) == 1
        self.i, self.j = i[near], j[near]
        self.k = 0.5 * (k[self.i] + k[self.j])
        self.L2 = ((self.x0[self.i] - self.x0[self.j]) ** 2).sum(axis=1)

    def arms(self, dv):
        x = self.x0 + DT * (self.v + dv)
        r = x[self.i] - x[self.j]
        return r, (r * r).sum(axis=1) / self.L2

    def energy(self, dv):
        _, q = self.arms(dv)
        return 0.5 * np.sum(self.m[:, None] * dv**2) + np.sum(self.k * self.L2 / 8 * (q - 1) ** 2)

    def gradient(self, dv):
        r, q = self.arms(dv)
        g = self.m[:, None] * dv
        f = DT * (0.5 * self.k * (q - 1))[:, None] * r
        np.add.at(g, self.i, f)
        np.add.at(g, self.j, -f)
        return g

    def hessian(self, dv):
        """With the negative eigenvalues of every spring set to zero."""
        r, q = self.arms(dv)
        n, d = dv.shape
        along = np.einsum("ea,eb->eab", r, r) / (r * r).sum(axis=1)[:, None, None]
        h = (np.maximum(3 * q - 1, 0.0)[:, None, None] * along
             + np.maximum(q - 1, 0.0)[:, None, None] * (np.eye(d) - along))
        h *= (DT**2 * 0.5 * self.k)[:, None, None]
        H = np.zeros((n, n, d, d))
        H[np.arange(n), np.arange(n)] = self.m[:, None, None] * np.eye(d)
        for a, b, sign in ((self.i, self.i, 1), (self.j, self.j, 1),
                           (self.i, self.j, -1), (self.j, self.i, -1)):
            np.add.at(H, (a, b), sign * h)
        return H.transpose(0, 2, 1, 3)


def lattice(shape=(4, 9), stiff=1.0, contrast=1e3, seed=0):
    """A strip whose upper half is `contrast` times stiffer, pulled and twisted, its bottom held."""
    rng = np.random.default_rng(seed)
    nodes = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, len(shape))
    n, d = nodes.shape
    upper = nodes[:, -1] > shape[-1] // 2
    k = stiff * np.where(upper, contrast, 1.0)
    m = rng.uniform(0.5, 1.5, n)
    v = 0.2 * rng.standard_normal((n, d)) + 0.3 * nodes[:, -1:]
    springs = Springs(nodes, m, k, v)
    functions = springs.energy, springs.gradient, springs.hessian
    start = np.zeros((n, d))
    start[nodes[:, -1] == 0] = -v[nodes[:, -1] == 0]
    toy = Toy(functions, start, kappa=DT * k * EDGE, B=conditions(nodes, d))
    toy.index = nodes - 2       # some of them negative
    return toy


def conditions(nodes, d):
    """Projectors: the bottom is held, one corner at the top slips on an oblique plane."""
    B = np.tile(np.eye(d), (len(nodes), 1, 1))
    B[nodes[:, -1] == 0] = 0.0
    normal = np.arange(1.0, d + 1)
    normal /= np.linalg.norm(normal)
    B[-1] -= np.outer(normal, normal)
    return B


def bar(seed=0):
    return lattice(stiff=100.0, seed=seed)


def tight(word, eps=1e-11):
    """Options that measure every method's gradient alike, down to round-off."""
    return options_of(word, norm="characteristic", eps=eps)


class Exact:
    """A hierarchy whose cycle is the pseudo-inverse on its only level."""

    def __init__(self, A, *_, **__):
        self.inverse = np.linalg.pinv(A.toarray(), hermitian=True)
        self.calls, self.iterations = [], 0

    def cycle(self, b, on_coarsest=nullcontext):
        self.calls.append(b.copy())
        with on_coarsest():
            return self.coarsest(b, b)

    def coarsest(self, b, load):
        return (self.inverse @ b.reshape(-1)).reshape(b.shape)


def exactly(monkeypatch):
    """Let hierarchies be `Exact`; returns the list of those that will be built."""
    built = []

    def build(*arguments, **more):
        built.append(Exact(*arguments, **more))
        return built[-1]
    monkeypatch.setattr(linearization, "hierarchy", build)
    monkeypatch.setattr(linearization, "hierarchy_from_matrices",
                        lambda matrices, *_, **__: build(*matrices[0]))
    return built
