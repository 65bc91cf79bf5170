"""The exact discrete adjoint of explicit steps, phase by phase and backwards.

    deform -> damp -> g2p -> boundaries -> grid update -> p2g       (see `explicit`)

A bar is the gradient of a loss with respect to the field of the same name; the bars of particles
are kept in a `Particles`, with arrays that share no memory. The stress that a step reads belongs
to the deformation before it, so its bar travels backwards as part of the state. `tape` records
runs of many steps, and is what one usually wants.
"""

import numpy as np

from .core.adjoint import corotated, full, strain
from .core.adjoint import deform as deform_adjoint
from .core.adjoint.boundary import solve_adjoint
from .core.adjoint.deform import DeformBars, DeformStep
from .core.adjoint.grid import Update, update_adjoint
from .core.adjoint.records import packed_bars, packed_velocities, unpack, zero_records
from .core.adjoint.transfer import Exchange, g2p_adjoint, p2g_adjoint, velocity_gradients
from .core.boundary import solve
from .core.grid import GridBox, Storage, update
from .core.jit import CHUNKS
from .core.law import kirchhoff_bar, kirchhoff_vjp, project_vjp, returned_bar
from .core.order import slabs_of
from .core.state import NONE
from .core.surface import AT_NODES
from .explicit import damp, scatter
from .materials import NoFlow
from .materials.learned.guard import is_guarded
from .materials.learned.network import has_single_layers


class StepAdjoint:
    """Carries bars back through single steps of a `Stepper`, reusing grid storage.

    Raises ValueError for a stepper whose steps it does not know.
    """

    def __init__(self, stepper):
        if stepper.implicit:
            raise ValueError(
                f"a {type(stepper).__name__} is implicit: expected an explicit Stepper, the only "
                "one that has an adjoint"
            )
        if stepper.conditions is not None and not hasattr(stepper.conditions, "touched"):
            raise ValueError(
                f"conditions of type {type(stepper.conditions).__name__} have no adjoint: "
                "expected core.boundary.Conditions, or None"
            )
        if hasattr(stepper.conditions, "apply_at_surface"):
            raise ValueError(AT_NODES)
        if stepper.contacts:
            raise ValueError("contact of bodies has no adjoint: expected a Stepper without")
        if stepper.scheme.precision != "double":
            raise ValueError(f"precision = {stepper.scheme.precision!r}: the adjoint computes in "
                             "double alone; expected a scheme with precision = 'double'")
        if stepper.scheme.f_bar:
            raise ValueError("f_bar = True: averaged volumes have no adjoint; expected a scheme "
                             "with f_bar = False")
        self.scheme, self.gravity = stepper.scheme, stepper.gravity.copy()
        self.conditions = stepper.conditions
        sizes = (stepper.dx, self.scheme.stencil, len(self.gravity),
                 self.scheme.keeps_old_velocity)
        self.storage, self.storage_of_bars = Storage(*sizes), Storage(*sizes)

    def pull_back(self, bodies, bars, sums, t, dt):
        """Turn bars of the state after a step into those before it, in place; returns the bar of
        gravity (d,).

        bodies hold the state before the step that began at t [s], with stress, and keep it; bars
        has a `Particles` for each body; each of sums, (CHUNKS, parameters), gets the bars of the
        law's and the flow's parameters added.
        """
        grid, free, touched = self._grid(bodies, t, dt)
        moved = packed_velocities(grid)
        for body, bar, parts in zip(bodies, bars, sums):
            self._deform(body, moved, bar, parts, dt)
        return self._transfer(bodies, bars, (grid._replace(v=free), moved, touched), dt)

    def _grid(self, bodies, t, dt):
        """Return the grid of the step, its velocities before conditions, and the contacts of its
        nodes.
        """
        scheme = self.scheme
        grid = scatter(bodies, self.storage, scheme, dt)
        update(grid, self.gravity, dt, scheme.mass_eps, scheme.gravity_on_empty)
        free, touched = grid.v, ([], [], [])
        if self.conditions is not None:
            free, touched = grid.v.copy(), self.conditions.touched(grid, t + dt, dt)
            solve(*touched, grid)
        return grid, free, touched

    def _deform(self, body, moved, bar, parts, dt):
        """Compute the bars of F and y before the step, and of C and L, one array in MLS-MPM without
        relaxation; moved has the velocities of nodes, as a grid of records.
        """
        velocity_gradients(body.particles.x, moved, bar.L, self._exchange(dt))
        damp(body._replace(particles=bar), self.scheme)         # symmetric, hence its own adjoint
        deform_body_adjoint(body, bar.L, bar, parts, dt, self.scheme.one_gradient)

    def _exchange(self, dt):
        scheme = self.scheme
        return Exchange(scheme.stencil, dt, scheme.share(dt), scheme.transfer == "mls")

    def _transfer(self, bodies, bars, step, dt):
        """Pull bars of x, v, C, L after the step back to x, v, C, tau, m, V0, b before it."""
        scheme, (grid, moved, touched) = self.scheme, step
        nodes = self.storage_of_bars.zeroed(GridBox(grid.origin, grid.m.shape, grid.v.dtype.type))
        how = self._exchange(dt)
        of_moved = zero_records(nodes)
        for body, bar in zip(bodies, bars):
            slabs = slabs_of(body.particles.x, grid, scheme.stencil)
            g2p_adjoint(body.particles, moved, bar, of_moved, how, slabs)
        unpack(of_moved, nodes)
        solve_adjoint(touched, grid, nodes)
        options = Update(dt, scheme.mass_eps, scheme.gravity_on_empty)
        of_gravity = update_adjoint(grid, nodes, self.gravity, options)
        of_nodes = packed_bars(nodes)
        for body, bar in zip(bodies, bars):
            p2g_adjoint(body.particles, of_nodes, bar, how)
        return of_gravity


def zero_bars(body):
    """Return the bars of a body, all zero."""
    return type(body.particles)(*(np.zeros_like(a) for a in body.particles))


def zero_sums(body):
    """Return storage for the bars of the parameters of a body's law and flow, chunk by chunk."""
    return np.zeros((CHUNKS, len(body.law) + len(body.flow)))


def require_adjoint(body):
    """Raise ValueError unless a body's law and flow have an adjoint."""
    learned = is_learned(body)
    laws = kirchhoff_bar.methods if learned else kirchhoff_vjp.methods
    flows = {**returned_bar.methods, NoFlow: None} if learned else project_vjp.methods
    for part, known in ((body.law, laws), (body.flow, flows)):
        if type(part) not in known:
            raise ValueError(f"body {body.name!r}: {type(part).__name__} has no adjoint here; "
                             f"expected one of {', '.join(sorted(c.__name__ for c in known))}")
        if has_single_layers(part):
            raise ValueError(f"body {body.name!r}: {type(part).__name__} has layers in single "
                             'precision, which have no adjoint; leave out precision = "single"')
        if is_guarded(part):
            raise ValueError(f"body {body.name!r}: {type(part).__name__} cuts its strains to a "
                             "box, which has no adjoint; expected learned laws without a guard")


def is_learned(body):
    """Return whether a body's law is a network of F, whose adjoint is that of the whole F."""
    return type(body.law) in kirchhoff_bar.methods


def deform_body_adjoint(body, L, bar, parts, dt, one_gradient=False):
    """Apply the adjoint of `explicit.deform_body` with velocity gradient L: bar.F and bar.y of the
    values after the step become those before it, and bar.L is overwritten; with one_gradient bar.L
    is left, and the bar of L is added to bar.C. bar.tau is read. L may be the array of bar.L.
    Raises ValueError for a law or a flow without adjoint.
    """
    require_adjoint(body)
    q, law, flow = body.particles, body.law, body.flow
    bars = _of_deformation(bar)._replace(C=bar.C if one_gradient else NONE)
    step = DeformStep(q.F, q.y, L, parts, dt)
    with_flow = () if q.F.ndim == 1 or isinstance(flow, NoFlow) else (flow,)
    _driver(body)(step, bars, law, *with_flow)


def _driver(body):
    """Return the loop over particles by which `deform_body_adjoint` differentiates a body."""
    if body.particles.F.ndim == 1:
        return deform_adjoint.fluid
    if is_learned(body):
        return full.elastic if isinstance(body.flow, NoFlow) else full.plastic
    if not isinstance(body.flow, NoFlow):
        return deform_adjoint.plastic
    for by_blocks in (corotated, strain):
        if by_blocks.fits(body.law, body.particles.x.shape[1]):
            return by_blocks.elastic
    return deform_adjoint.elastic


def clip_adjoint(positions, bars, low, high):
    """Apply the adjoint of a clip to the box low .. high, (d,) each: bar.x of each body becomes 0
    for the coordinates that it holds. positions: x (N, d) of each body after it.
    """
    for x, bar in zip(positions, bars):
        bar.x[(x <= low) | (x >= high)] = 0.0


def initial_stress_adjoint(body, bar, parts):
    """Apply the adjoint of `explicit.initial_stress`: bar.tau is pulled back and added to bar.F."""
    q, bars = body.particles, _of_deformation(bar)
    if q.F.ndim == 1:
        deform_adjoint.initial_pressure(q.F, bars, body.law, parts)
    elif is_learned(body):
        full.initial_stress(q.F, bars, body.law)
    else:
        deform_adjoint.initial_stress(q.F, q.y, bars, body.law, body.flow, parts)


def _of_deformation(bar):
    return DeformBars(bar.F, bar.tau, bar.L, bar.y, NONE)
