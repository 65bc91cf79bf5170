"""The term of the loss for what a second return map changes. Needs PyTorch."""

import pytest
from nclaw_toys import cube

from tests.nclaw.test_invariants import near_rest

torch = pytest.importorskip("torch")

from mpm_ref.materials import (  # noqa: E402
    DruckerPrager,
    Fluid,
    FluidProjection,
    Hencky,
    VonMises,
)
from mpm_ref.nclaw.batched_step import make_nodes, make_world  # noqa: E402
from mpm_ref.nclaw.dissipation import returned  # noqa: E402
from mpm_ref.nclaw.train.observations import trajectory_of  # noqa: E402
from mpm_ref.nclaw.train.recipe import Recipe  # noqa: E402
from mpm_ref.nclaw.train.rollout import (  # noqa: E402
    LawPair,
    over_points,
    second_return,
    segment_errors,
    step,
)
from mpm_ref.trajectories import observed  # noqa: E402

STEPS = 5

pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture(scope="module")
def run():
    """`World` and `Trajectory` of a small cube."""
    problem = cube(STEPS)
    return make_world(problem), trajectory_of(observed(problem))


@pytest.mark.parametrize("keep_every", [1, 2])
def test_a_second_return_counts_as_told(run, keep_every):
    """In the loss, beside errors of positions, times its weight [m^2], after each step of each
    segment.
    """
    half = LawPair(torch.zeros_like, halfway)
    none, one = (segment_errors(half, *run, [0, 3], [3, STEPS],
                                Recipe(idempotence=weight, keep_every=keep_every))
                 for weight in (0.0, 1e-3))
    expected = 0.0
    for level, count in ((0, 3), (3, 2)):
        state, nodes = run[1].states(torch.tensor([level])), make_nodes(run[0], 1)
        for _ in range(count):
            state = step(half, run[0], state, nodes)
            expected += 1e-3 * (0.25 * (state[3] - torch.eye(3)) ** 2).mean().item()
    assert (one.loss - none.loss).item() == pytest.approx(expected, rel=1e-9)
    assert one.positions == none.positions


def halfway(F):
    """A map that is no projection: half of the way to I, squared displacements by a quarter."""
    return torch.eye(3) + 0.5 * (F - torch.eye(3))


@pytest.mark.parametrize(("law", "flow"), [(Fluid(2.0), FluidProjection()),
                                           (Hencky(2.0, 1.0), VonMises(0.3, 0.05)),
                                           (Hencky(2.0, 1.0), DruckerPrager(0.3, 0.05))])
def test_projections_have_no_second_return(law, flow, rng):
    """Of the true flows, which change F; a map that goes half of the way has one."""
    F = torch.from_numpy(near_rest(12, 3, rng)).reshape(2, 6, 3, 3)
    once = over_points(flow_of(law, flow), F)
    assert (once - F).abs().amax(dim=(1, 2, 3)).min() > 0.01
    assert second_return(flow_of(law, flow), once) < 1e-28
    assert second_return(halfway, F) == pytest.approx(
        0.25 * ((F - torch.eye(3)) ** 2).mean(dim=(1, 2, 3)).sum().item(), rel=1e-12)


def flow_of(law, flow):
    """A true flow as a function of tensors F (n, 3, 3)."""
    return lambda F: torch.from_numpy(returned(law, flow, F.numpy()))
