"""The grid of every frame as VTKHDF ImageData: nodal density and velocity, from the particles.

Results hold particles only; the grid is made again by the transfer from particles to grid, without
affine motion. All frames share one box of nodes, at integer multiples of dx as in the run.
"""

import numpy as np

from ..body import Body, particles_at
from ..core.grid import Storage
from ..explicit import Scheme, scatter
from ..materials import NoFlow
from .atomic import replacing, require_space
from .journal import new_hdf5
from .vtkhdf import root_of, three


def export_grid(results, out):
    """Write nodal density [kg/m^d] and velocity [m/s] of all frames of `Results` to `out`.

    Raises `NotWritten`, and `BadResults` without a frame or if v is not stored.
    """
    results.index(0)            # there must be a frame
    scheme = Scheme(degree=results.degree, transfer="pic")
    first, shape = _box(results, scheme)
    require_space(out, 16 * len(results) * int(np.prod(shape)))
    with replacing(out) as part, new_hdf5(part) as h5:
        root = root_of(h5, "ImageData")
        _place(root, first, shape, results.dx)
        images = (len(results), *shape[::-1])
        density = root.create_dataset("PointData/density", images, "f4")
        velocity = root.create_dataset("PointData/velocity", (*images, 3), "f4")
        for k in range(len(results)):
            grid = _grid(results, k, scheme)
            at = (k, *_within(grid, first))
            density[at] = _image(grid.m, results.dim) / results.dx**results.dim
            velocity[at] = _image(three(_velocity(grid)), results.dim)
        _steps(root, results.time)


def _grid(results, frame, scheme):
    bodies = [_body(results, name, frame) for name in results.bodies]
    return scatter(bodies, Storage(results.dx, scheme.stencil, results.dim), scheme, 0.0)


def _body(results, name, frame):
    x, v = results.field(name, "x", frame), results.field(name, "v", frame)
    m, V0 = results.field(name, "m"), results.field(name, "V0")
    return Body(name, particles_at(x, v, m, V0, "pic"), None, NoFlow(), np.arange(len(x)))


def _box(results, scheme):
    """(index of the first node, shape) of the nodes that particles reach in any frame."""
    ends = [(x.min(axis=0), x.max(axis=0)) for body in results.bodies
            for x in (results.field(body, "x", k) for k in range(len(results)))]
    corners = np.array([np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))])
    grid = Storage(results.dx, scheme.stencil, results.dim).cover([corners])
    return grid.origin.copy(), grid.m.shape


def _velocity(grid):
    """Momentum over mass, 0 on empty nodes."""
    m = grid.m[..., None]
    return np.divide(grid.v, m, out=np.zeros_like(grid.v), where=m > 0.0)


def _image(a, dim):
    """Nodal values (n1, .., nd[, components]) with the axes of an image: [z,] y, x[, components].
    VTK wants no z axis where the image is flat.
    """
    return a.transpose(*range(dim)[::-1], *range(dim, a.ndim))


def _within(grid, first):
    """Where the nodes of a grid lie in the box, as slices along [z,] y, x."""
    start = grid.origin - first
    return [slice(s, s + n) for s, n in zip(start, grid.m.shape, strict=True)][::-1]


def _place(root, first, shape, dx):
    """Extent and position of the box in space."""
    flat = 3 - len(shape)
    root.attrs["WholeExtent"] = np.array([[0, n - 1] for n in (*shape, *[1] * flat)], "i8").ravel()
    root.attrs["Origin"] = np.array([*(first * dx), *[0.0] * flat])
    root.attrs["Spacing"] = np.full(3, dx)
    root.attrs["Direction"] = np.eye(3).ravel()


def _steps(root, time):
    n = len(time)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = n
    steps["Values"] = np.asarray(time, dtype=float)
    for name in ("density", "velocity"):
        steps[f"PointDataOffsets/{name}"] = np.arange(n, dtype="i8")
