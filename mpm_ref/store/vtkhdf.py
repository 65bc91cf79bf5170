"""Export results as VTKHDF, the file format of VTK and ParaView, with h5py alone.

Particles become temporal PolyData: one vertex each, the topology stored once for all frames, or for
each of them where particles enter and leave. The grid becomes ImageData: nodal density and
velocity, computed again from the particles by the PIC transfer, in one box of nodes at integer
multiples of dx as in the run. Values are in single precision, for display; the results file has
them in double. 2D lies in the plane z = 0. Format: VTKHDF specification, version 2.0
(docs.vtk.org).
"""

import numpy as np

from ..body import Body, filled, particles_at
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
    there = [_gather(results, lambda body, k=k: results.present(body, k))
             for k in range(len(results))]
    starts = np.cumsum([0, *(mask.sum() for mask in there)])
    rows = int(starts[-1])
    require_space(out, 4 * rows * (8 + sum(VALUES[name][1] for name in names)))
    with replacing(out) as part, new_hdf5(part) as h5:
        root = create_root(h5, "PolyData")
        one = all(mask.all() for mask in there)
        _topology(root, np.diff(starts)[:1] if one else np.diff(starts))
        points = root.create_dataset("Points", (rows, 3), "f4")
        data = {name: _values(root, name, rows) for name in names}
        for k, mask in enumerate(there):
            at = slice(starts[k], starts[k + 1])
            x = _gather(results, lambda body, k=k: three(results.field(body, "x", k)))
            points[at] = x[mask]
            for name, dataset in data.items():
                dataset[at] = _gather(results, lambda body, k=k, name=name:
                                      _value(results, body, name, k))[mask]
        _steps(root, results.time, starts[:-1], names)
        if not one:
            _put_parts(root["Steps"], starts[:-1])


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


def _topology(root, counts):
    """Write the topology of parts with these numbers of particles: one vertex per particle, no
    other cells.
    """
    root["NumberOfPoints"] = counts.astype("i8")
    for name in TOPOLOGIES:
        n = counts if name == "Vertices" else 0 * counts
        group = root.create_group(name)
        group["NumberOfCells"] = group["NumberOfConnectivityIds"] = n.astype("i8")
        group["Offsets"] = np.concatenate([np.arange(c + 1, dtype="i8") for c in n])
        group["Connectivity"] = np.concatenate([np.arange(c, dtype="i8") for c in n])


def _put_parts(steps, starts):
    """Let each frame have a part of its own, whose particles begin at `starts` (T,)."""
    steps["PartOffsets"][:] = np.arange(len(starts))
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name][:, TOPOLOGIES.index("Vertices")] = starts


def _values(root, name, rows):
    shape = (rows, 3) if VALUES[name][1] == 3 else (rows,)
    kind = "i4" if name == "body" else "f4"
    return root.require_group("PointData").create_dataset(name, shape, kind)


def _steps(root, time, starts, names):
    """Write the times and the offset of each frame; the topology starts at 0 for all."""
    n = len(time)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = n
    steps["Values"] = np.asarray(time, dtype=float)
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
            if grid is None:            # no particle is there: the images stay 0
                continue
            at = (k, *_within(grid, first))
            density[at] = _image(grid.m, results.dim) / results.dx**results.dim
            velocity[at] = _image(three(_velocity(grid)), results.dim)
        _image_steps(root, results.time)


def _grid(results, frame, scheme):
    bodies = filled(_body(results, name, frame) for name in results.bodies)
    if not bodies:
        return None
    return scatter(bodies, Storage(results.dx, scheme.stencil, results.dim), scheme, 0.0)


def _body(results, name, frame):
    there = results.present(name, frame)
    x, v = (results.field(name, field, frame)[there] for field in ("x", "v"))
    m, V0 = (results.field(name, field)[there] for field in ("m", "V0"))
    return Body(name, particles_at(x, v, m, V0, "pic"), None, NoFlow(), np.arange(len(x)))


def _box(results, scheme):
    """Return the index of the first node and the shape of the box that covers all frames."""
    found = [results.field(body, "x", k)[results.present(body, k)]
             for body in results.bodies for k in range(len(results))]
    ends = [(x.min(axis=0), x.max(axis=0)) for x in found if len(x)]
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
