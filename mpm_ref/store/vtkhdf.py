"""Export results as VTKHDF, the file format of VTK and ParaView, with h5py alone.

Particles become temporal PolyData: one vertex each, the topology stored once for all frames. The
grid becomes ImageData: nodal density and velocity, computed again from the particles by the PIC
transfer, in one box of nodes at integer multiples of dx as in the run. Values are in single
precision, for display; the results file has them in double. 2D lies in the plane z = 0. Format:
VTKHDF specification, version 2.0 (docs.vtk.org).
"""

import numpy as np

from ..body import Body, particles_at
from ..core.grid import Storage
from ..explicit import Scheme, scatter
from ..materials import NoFlow
from .atomic import replacing, require_space
from .journal import new_hdf5

TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
VALUES = {                 # name -> what offers it (see `results.SCALARS`), number of components
    "v": ("speed", 3), "J": ("J", 1), "tau_norm": ("tau", 1), "body": ("body", 1),
}


def export_particles(results, out):
    """Write the particles of all frames of `Results` to `out`.

    Point data: v [m/s], J and tau_norm [Pa], if the stored fields suffice for them, and the index
    of the body. Raises `NotWritten`, and `BadResults` without a frame.
    """
    results.index(0)            # there must be a frame
    names = [name for name, (scalar, _) in VALUES.items() if results.offers(scalar)]
    count, frames = sum(map(results.count, results.bodies)), len(results)
    require_space(out, 4 * count * (frames * (3 + sum(VALUES[name][1] for name in names)) + 5))
    with replacing(out) as part, new_hdf5(part) as h5:
        root = create_root(h5, "PolyData")
        _topology(root, count)
        points = root.create_dataset("Points", (frames * count, 3), "f4")
        data = {name: _values(root, name, frames * count) for name in names}
        for k in range(frames):
            rows = slice(k * count, (k + 1) * count)
            points[rows] = _gather(results, lambda body, k=k: three(results.field(body, "x", k)))
            for name, dataset in data.items():
                dataset[rows] = _gather(results, lambda body, k=k, name=name:
                                        _value(results, body, name, k))
        _steps(root, results.time, count, names)


def _value(results, body, name, frame):
    if name == "v":
        return three(results.field(body, "v", frame))
    return results.scalar(body, VALUES[name][0], frame)


def _gather(results, rows):
    """Return the rows of all bodies, one body after the other."""
    return np.concatenate([rows(body) for body in results.bodies])


def three(a):
    """Return vectors (.., d) with three components (.., 3), the third 0 in 2D."""
    return np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, 3 - a.shape[-1])])


def create_root(h5, kind):
    """Create the group that VTK reads, for a kind of data set."""
    root = h5.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0], dtype="i8")
    root.attrs.create("Type", kind.encode("ascii"), dtype=f"S{len(kind)}")     # as VTK asks for it
    return root


def _topology(root, count):
    """Write the topology: one vertex per particle, no other cells."""
    root["NumberOfPoints"] = np.array([count], dtype="i8")
    for name in TOPOLOGIES:
        n = count if name == "Vertices" else 0
        group = root.create_group(name)
        group["NumberOfCells"] = group["NumberOfConnectivityIds"] = np.array([n], dtype="i8")
        group["Offsets"] = np.arange(n + 1, dtype="i8")
        group["Connectivity"] = np.arange(n, dtype="i8")


def _values(root, name, rows):
    shape = (rows, 3) if VALUES[name][1] == 3 else (rows,)
    kind = "i4" if name == "body" else "f4"
    return root.require_group("PointData").create_dataset(name, shape, kind)


def _steps(root, time, count, names):
    """Write the times and the offset of each frame; the topology starts at 0 for all."""
    n = len(time)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = n
    steps["Values"] = np.asarray(time, dtype=float)
    starts = np.arange(n, dtype="i8") * count
    steps["PartOffsets"] = np.zeros(n, dtype="i8")
    steps["NumberOfParts"] = np.ones(n, dtype="i8")
    steps["PointOffsets"] = starts
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((n, len(TOPOLOGIES)), dtype="i8")
    for name in names:
        steps[f"PointDataOffsets/{name}"] = starts


def export_grid(results, out):
    """Write nodal density [kg/m^3] and velocity [m/s] of all frames of `Results` to `out`.

    Raises `NotWritten`, and `BadResults` without a frame or if v is not stored.
    """
    results.index(0)            # there must be a frame
    scheme = Scheme(results.degree, "pic", gimp=results.gimp)
    first, shape = _box(results, scheme)
    require_space(out, 16 * len(results) * int(np.prod(shape)))
    with replacing(out) as part, new_hdf5(part) as h5:
        root = create_root(h5, "ImageData")
        _place(root, first, shape, results.dx)
        images = (len(results), *shape[::-1])
        density = root.create_dataset("PointData/density", images, "f4")
        velocity = root.create_dataset("PointData/velocity", (*images, 3), "f4")
        for k in range(len(results)):
            grid = _grid(results, k, scheme)
            at = (k, *_within(grid, first))
            density[at] = _image(grid.m, results.dim) / results.dx**results.dim
            velocity[at] = _image(three(_velocity(grid)), results.dim)
        _image_steps(root, results.time)


def _grid(results, frame, scheme):
    bodies = [_body(results, name, frame) for name in results.bodies]
    return scatter(bodies, Storage(results.dx, scheme.stencil, results.dim), scheme, 0.0)


def _body(results, name, frame):
    x, v = results.field(name, "x", frame), results.field(name, "v", frame)
    m, V0 = results.field(name, "m"), results.field(name, "V0")
    return Body(name, particles_at(x, v, m, V0, "pic"), None, NoFlow(), np.arange(len(x)))


def _box(results, scheme):
    """Return the index of the first node and the shape of the box that covers all frames."""
    ends = [(x.min(axis=0), x.max(axis=0)) for body in results.bodies
            for x in (results.field(body, "x", k) for k in range(len(results)))]
    corners = np.array([np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))])
    grid = Storage(results.dx, scheme.stencil, results.dim).cover([corners])
    return grid.origin.copy(), grid.m.shape


def _velocity(grid):
    """Return momentum over mass, 0 on empty nodes."""
    m = grid.m[..., None]
    return np.divide(grid.v, m, out=np.zeros_like(grid.v), where=m > 0.0)


def _image(a, dim):
    """Transpose nodal values (n1, .., nd[, components]) to the axes of an image, [z,] y, x.

    VTK expects no z axis in 2D.
    """
    return a.transpose(*range(dim)[::-1], *range(dim, a.ndim))


def _within(grid, first):
    """Return the slices of the box that a grid covers, along [z,] y, x."""
    start = grid.origin - first
    return [slice(s, s + n) for s, n in zip(start, grid.m.shape, strict=True)][::-1]


def _place(root, first, shape, dx):
    """Write the extent and position of the box in space."""
    flat = 3 - len(shape)
    root.attrs["WholeExtent"] = np.array([[0, n - 1] for n in (*shape, *[1] * flat)], "i8").ravel()
    root.attrs["Origin"] = np.array([*(first * dx), *[0.0] * flat])
    root.attrs["Spacing"] = np.full(3, dx)
    root.attrs["Direction"] = np.eye(3).ravel()


def _image_steps(root, time):
    n = len(time)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = n
    steps["Values"] = np.asarray(time, dtype=float)
    for name in ("density", "velocity"):
        steps[f"PointDataOffsets/{name}"] = np.arange(n, dtype="i8")
