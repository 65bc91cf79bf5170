"""The compiled adjoint of a step of deformation: as the plain text, for any number of threads, and
as torch's automatic differentiation of the formulas.
"""

import numpy as np
import pytest
from deform_bars import DT, apart, materials, matter, named, seeds, states
from problems import run_python
from threads import MOST, by_threads

from mpm_ref.adjoint import deform_body_adjoint
from mpm_ref.body import Body
from mpm_ref.core.adjoint import corotated, deform, strain
from mpm_ref.core.corotated import BLOCK
from mpm_ref.core.jit import CHUNKS
from mpm_ref.materials import FixedCorotated, Hencky, NoFlow

CASES = {"von_mises_hardening": 3, "none on fixed_corotated": 3, "none on hencky": 3,
         "fluid of J": 2}
BLOCKS = {"none on fixed_corotated": corotated, "none on hencky": strain}
N = 150             # more particles than chunks
CODE = f"""
import json
import numpy as np
from deform_bars import gradients, materials
from tests.adjoint.test_deform_compiled import scattered
found = {{}}
for name, d in {CASES!r}.items():
    law, flow, _ = materials(d)[name]
    of_q = gradients(scattered(name), law, flow)
    found[name] = {{key: np.asarray(g).tolist() for key, g in of_q.items()}}
print(json.dumps(found))
"""


def scattered(name):
    """Random states of a case."""
    d = CASES[name]
    rng = np.random.default_rng(4)
    return states(rng, np.exp(0.2 * rng.standard_normal((N, d))), materials(d)[name])


def driven(name):
    """bars, sums of the parallel drivers."""
    q, (law, flow, _) = scattered(name), materials(CASES[name])[name]
    bars, step, _ = seeds(q, law, flow)
    if q.F.ndim == 1:
        deform.fluid(step, bars, law)
    elif isinstance(flow, NoFlow):
        BLOCKS[name].elastic(step, bars, law)
    else:
        deform.plastic(step, bars, law, flow)
    return bars, step.sums


def at_start(name):
    """bars, sums of the stress of the states as they stand."""
    q, (law, flow, _) = scattered(name), materials(CASES[name])[name]
    bars, step, _ = seeds(q, law, flow)
    if q.F.ndim == 1:
        deform.initial_pressure(q.F, bars, law, step.sums)
    else:
        deform.initial_stress(q.F, q.y, bars, law, flow, step.sums)
    return bars, step.sums


def bits(bars, sums):
    return [a.tobytes() for a in (*bars, sums)]


@pytest.fixture(scope="module")
def plain():
    return run_python(CODE, NUMBA_DISABLE_JIT="1")


@pytest.mark.parametrize("name", CASES)
def test_as_the_plain_text(plain, name):
    law, flow, _ = materials(CASES[name])[name]
    expected = {key: np.array(g) for key, g in plain[name].items()}
    assert max(apart(named(*driven(name), law, flow), expected).values()) < 1e-13


@pytest.mark.parametrize("n", [N, CHUNKS * (BLOCK + 7)], ids=["parts of blocks", "blocks"])
@pytest.mark.parametrize("law", [FixedCorotated(300.0, 500.0), Hencky(300.0, 500.0)],
                         ids=["fixed_corotated", "hencky"])
def test_without_singular_values_as_with_them(law, n):
    """Far from singular, through rest, and where the loop falls back to singular values."""
    rng = np.random.default_rng(6)
    s = np.exp(0.3 * rng.standard_normal((n, 3)))
    s[:20], s[20:40, 2] = 1.0, 0.1
    if isinstance(law, Hencky):
        run = strain
    else:
        run, s[20:40, 2], s[40:60] = corotated, 1e-3, s[40:60] * (1.0, 1.0, -1.0)
    q = states(rng, rng.permutation(s), (law, NoFlow(), False))
    found = []
    for module in (run, deform):
        bars, step, _ = seeds(q, law, NoFlow())
        module.elastic(step, bars, law)
        found.append(named(bars, step.sums, law, NoFlow()))
    assert max(apart(*found).values()) < 1e-13


@pytest.mark.parametrize("size", [0.003, 0.1, 0.39, 0.41, 0.59])
def test_derivative_of_a_strain_of_any_size(size):
    """On both sides of the size from which singular values are used: to round-off of both."""
    law, rng = Hencky(300.0, 500.0), np.random.default_rng(8)
    eps = rng.standard_normal((N, 3))
    s = np.exp(size * eps / np.linalg.norm(eps, axis=1)[:, None])
    q, found = states(rng, s, (law, NoFlow(), False)), []
    for module in (strain, deform):
        bars, step, _ = seeds(q, law, NoFlow())
        module.elastic(step, bars, law)
        found.append(bars)
    assert np.abs(found[0].F - found[1].F).max() < 1e-14 * np.abs(found[1].F).max()


@pytest.mark.parametrize("name", CASES)
def test_a_body_is_differentiated_by_the_loop_of_its_material(name):
    q, (law, flow, _) = scattered(name), materials(CASES[name])[name]
    bars, step, _ = seeds(q, law, flow)
    body = Body("body", matter(q), law, flow, np.arange(N))
    deform_body_adjoint(body, q.L, bars, step.sums, DT)
    assert bits(bars, step.sums) == bits(*driven(name))


@pytest.mark.parametrize("name", BLOCKS)
def test_bar_of_a_shared_gradient_joins_that_of_C(name):
    """Where L and C are one field."""
    law, flow, _ = materials(3)[name]
    q = scattered(name)
    for run in (BLOCKS[name], deform):
        apart_bars, step, _ = seeds(q, law, flow)
        joined, again, _ = seeds(q, law, flow)
        C = np.random.default_rng(7).standard_normal(q.L.shape)
        joined = joined._replace(L=again.L, C=C.copy())
        run.elastic(step, apart_bars, law)
        run.elastic(again, joined, law)
        assert np.array_equal(joined.C, C + apart_bars.L)
        assert np.array_equal(joined.F, apart_bars.F)
        assert np.array_equal(joined.L, q.L)


@pytest.mark.skipif(MOST < 2, reason="one core")
@pytest.mark.parametrize("name", CASES)
def test_threads_do_not_change_a_bit(name):
    one, two = by_threads(lambda: (bits(*driven(name)), bits(*at_start(name))))
    assert one == two


# Automatic differentiation, which needs singular values that differ.

def torch_step(torch, q, law, flow):
    """Leaves of the graph by name, and F, tau, y after the step."""
    given = {name: getattr(q, name) for name in ("F", "L", "y")} | law._asdict() | flow._asdict()
    x = {name: torch.tensor(a, dtype=torch.float64, requires_grad=True)
         for name, a in given.items()}
    F = (torch.eye(q.L.shape[1], dtype=torch.float64) + DT * x["L"]) @ x["F"]
    U, s, Vh = torch.linalg.svd(F)
    step = torch_fixed_corotated if isinstance(flow, NoFlow) else torch_hardening
    return x, step(torch, x, F, (U, s, Vh))


def torch_fixed_corotated(torch, x, F, svd):
    """NSF-eq12."""
    J = torch.linalg.det(F)[:, None, None]
    volumetric = x["lam"] * (J - 1) * J * torch.eye(F.shape[1], dtype=F.dtype)
    return F, 2 * x["mu"] * (F - svd[0] @ svd[2]) @ F.mT + volumetric, x["y"]


def torch_hardening(torch, x, F, svd):
    """NSF-eq13 and NSF-F4."""
    U, s, Vh = svd
    eps = torch.log(s)
    mean = eps.mean(dim=1, keepdim=True)
    size = (eps - mean).norm(dim=1)
    dgamma = torch.relu(size - x["y"] / (2 * x["mu"]))
    eps = mean + (1 - dgamma / size)[:, None] * (eps - mean)
    tau = 2 * x["mu"] * eps + x["lam"] * eps.sum(dim=1, keepdim=True)
    y = x["y"] + 2 * x["mu"] * x["xi"] * dgamma
    return U * eps.exp()[:, None] @ Vh, U * tau[:, None] @ U.mT, y


@pytest.mark.parametrize("name", ["von_mises_hardening", "none on fixed_corotated"])
def test_as_automatic_differentiation(name):
    torch = pytest.importorskip("torch")
    q, (law, flow, _) = scattered(name), materials(CASES[name])[name]
    x, after = torch_step(torch, q, law, flow)
    sum((a * torch.tensor(w)).sum() for a, w in zip(after, q.weights)).backward()
    expected = {key: np.zeros(a.shape) if a.grad is None else a.grad.numpy()
                for key, a in x.items()}
    assert max(apart(named(*driven(name), law, flow), expected).values()) < 1e-10
