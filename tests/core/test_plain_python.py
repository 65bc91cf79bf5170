"""The same text without compilation: equal to the compiled code and to the twin, within bounds."""

from pathlib import Path

import numpy as np
import pytest
from problems import run_python, stepped, two_disks

PLAIN = {"NUMBA_DISABLE_JIT": "1"}

STATE = """
import json
from problems import stepped, two_disks
bodies = stepped(two_disks(), 2)
print(json.dumps([{name: getattr(b.particles, name).tolist() for name in "xvFyL"}
                  | {"tau": b.particles.tau.tolist()} for b in bodies]))
"""

TRANSFERS = """
import json
import numpy as np
from clouds import DX, EVERY, AFFINE, cloud, over, plain_grid, scattered
from mpm_ref.core.grid import update
from mpm_ref.core.transfer import g2p, rpic
from mpm_ref.plain.step import grid_to_particles

def off(a, b, scale=None):
    return float(abs(a - b).max() / abs(b if scale is None else scale).max())

def distances(case):
    q, dt, g = cloud(case, np.random.default_rng(1), n=12), 0.03, np.arange(1.0, 1.0 + case.d)
    matter, ip, nodes = plain_grid(case, q, dt, g)
    method = case.method._replace(rpic=0.3 if case.transfer in AFFINE and not case.relaxed else 0)
    moved = grid_to_particles(matter, ip, nodes, method, dt)
    grid = scattered(case, q, dt)
    found = [off(grid.m, over(grid, nodes.m, nodes.box))]
    update(grid, g, dt)
    m = grid.m[..., None]
    found.append(off(m * grid.v, m * over(grid, nodes.v, nodes.box)))
    g2p(q, grid, case.stencil, dt, 0.9, case.transfer == "mls")
    found.append(off(q.L, moved.L))
    if method.rpic:
        rpic(q.C, 0.3)
    return found + [off(getattr(q, n), getattr(moved, n)) for n in "vxC" if len(getattr(q, n))]

print(json.dumps({case.name: max(distances(case)) for case in EVERY}))
"""

MATERIALS = """
import json, warnings
import numpy as np
from clouds import twin
from mpm_ref import explicit
from mpm_ref.body import Body, particles_at
from mpm_ref.energy import elastic
from mpm_ref.materials import FLOWS, LAWS, make_flow, make_law
from mpm_ref.plain.laws import energy
from mpm_ref.plain.step import deform

PARAMETERS = {"friction_angle": 30.0, "sigma_y": 60.0, "xi": 0.3, "theta": 2e3, "eta": 5.0,
              "s_min": 0.95, "s_max": 1.05}
NEEDS = {"none": (), "drucker_prager": ("friction_angle", "s_min"),
         "von_mises": ("sigma_y",), "von_mises_hardening": ("sigma_y", "xi"),
         "von_mises_softening": ("sigma_y", "theta"), "herschel_bulkley": ("sigma_y", "eta"),
         "fluid_projection": (), "snow_clamp": ("s_min", "s_max"),
         "fixed_corotated_von_mises": ("sigma_y",)}

def distances(law, flow, d, J_only=False):
    rng, n, dt = np.random.default_rng(5), 40, 0.01
    z = np.zeros((n, d))
    q = particles_at(z, z, np.ones(n), np.ones(n), "pic", fluid=J_only)
    q.L[:] = rng.normal(size=(n, d, d)) * rng.choice([1.0, 5.0, 20.0], n)[:, None, None]
    if J_only:
        q.F[:] = rng.uniform(0.8, 1.2, n)
    else:
        q.F[:] += 0.02 * rng.normal(size=(n, d, d))
    if hasattr(flow, "theta") or hasattr(flow, "xi"):
        q = q._replace(y=rng.uniform(5.0, 60.0, n))
    body = Body("b", q, law, flow, np.arange(n))
    exact = deform(twin(q, law, flow, np.longdouble), q.L.astype(np.longdouble), dt)
    explicit.deform_body(body, dt)
    fields = ("F", "tau", "y") if q.y.ndim == 1 else ("F", "tau")
    stiff = max(law)
    off = {f: float(abs(getattr(q, f) - getattr(exact, f)).max()) for f in fields}
    changed = float(abs(exact.F - exact.F_trial).max())
    off["psi"] = float(abs(elastic(body) - energy(exact.F, law) * (q.y > 0 if hasattr(flow, "theta")
                                                                 else 1)).max())
    return [off["F"], max(v for f, v in off.items() if f != "F") / stiff, changed]

out = {}
for name, entry in FLOWS.items():
    for law_name in LAWS:
        law = make_law(law_name, E=1e3, nu=0.3)
        if isinstance(law, entry.laws):
            for d in (2, 3):
                flow = make_flow(name, law, d, **{k: PARAMETERS[k] for k in NEEDS[name]})
                out[f"{law_name} {name} {d}d"] = distances(law, flow, d)
out["fluid J"] = distances(make_law("fluid", lam=1e3), make_flow("none", law, 2), 2, True)
print(json.dumps(out))
"""

BOUNDS = """
import json
import numpy as np
from clouds import COVER, DX, cloud
from mpm_ref.core import order, transfer
from mpm_ref.core.grid import Storage, _update, flattened
from mpm_ref.core.transfer import gather, gather_mls, scatter, scatter_mls

def once(case, lost=0):
    q = cloud(case, np.random.default_rng(1), n=50)
    grid = Storage(DX, case.stencil, case.d, flip=case.separate).cover([q.x])
    members, n = np.arange(50), (0, 50)
    if lost:
        first, last = (slice(1, None),) * case.d, tuple(k - lost for k in grid.m.shape)
        cut = tuple(slice(0, k) for k in last)
        grid = grid._replace(m=grid.m[cut].copy(), v=grid.v[cut].copy())
    count = np.zeros(-(-grid.m.shape[0] // order.slab_width(case.stencil)), dtype=np.int64)
    cut = order.Cut(grid.origin[0], grid.dx)
    order._count(q.x[:, 0], cut, case.stencil, count, n)
    at, where = np.cumsum(count) - count, np.empty(50, dtype=np.int64)
    order._place(q.x[:, 0], cut, case.stencil, at, where, n)
    if case.transfer == "mls":
        scatter_mls(q, grid, case.stencil, 0.1, where)
        gather_mls(q, grid, case.stencil, 0.1, 1.0, n)
    else:
        scatter(q, grid, case.stencil, 0.1, where)
        gather(q, grid, case.stencil, 0.1, 1.0, n)
    _update(flattened(grid), np.zeros(case.d), 0.1, 0.0, (0, grid.m.size))
    return sorted(where.tolist()) == members.tolist()

cases = [c for c in COVER if c.name in ("apic2-2d", "mls2-2d-fluid")]
inside = [once(case) for case in cases]
caught = []
for case in cases:
    try:
        once(case, lost=2)
    except IndexError:
        caught.append(case.name)
print(json.dumps([inside, caught]))
"""


def test_the_twin_shares_no_text_with_the_kernels():
    plain = Path(__file__).resolve().parents[2] / "mpm_ref/plain"
    texts = [file.read_text(encoding="utf-8") for file in plain.glob("*.py")]
    assert len(texts) >= 8
    assert not [text for text in texts if "from .." in text or "import mpm_ref" in text]
    assert not [text for text in texts if "numba" in text or "from mpm_ref" in text]


def test_plain_python_equals_the_compiled_step():
    bodies, found = stepped(two_disks(), 2), run_python(STATE, **PLAIN)
    for body, other in zip(bodies, found):
        for name, a in other.items():
            b = getattr(body.particles, name)
            assert abs(np.array(a) - b).max(initial=0.0) <= 1e-12 * abs(b).max(initial=1e-300), name


def test_every_transfer_equals_its_twin():
    """All transfers, degrees and dimensions, full and isotropic stress, with and without b."""
    found = run_python(TRANSFERS, **PLAIN)
    assert len(found) == 64
    assert max(found.values()) < 3e-15


def test_every_material_equals_its_twin():
    """Deformation, return map, stress and energy of all laws and flows against longdouble."""
    found = run_python(MATERIALS, **PLAIN)
    assert len(found) >= 25
    bad = {name: off for name, off in found.items() if max(off[:2]) > 1e-14}
    assert not bad
    still = [name for name, off in found.items()
             if off[2] < 1e-3 and " none " not in name and name != "fluid J"]
    assert not still, "flows that did nothing here"


@pytest.mark.filterwarnings("ignore")
def test_kernels_stay_within_their_arrays(tmp_path):
    """The serial kernels compiled with bounds checks; a grid too small must be noticed."""
    inside, caught = run_python(BOUNDS, NUMBA_BOUNDSCHECK="1", NUMBA_CACHE_DIR=str(tmp_path))
    assert inside == [True, True]
    assert caught == ["apic2-2d", "mls2-2d-fluid"]
