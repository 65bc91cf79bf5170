from dataclasses import replace

import h5py
import numpy as np
import pytest
from small_runs import ENERGY, block, colliding, frame_of, state_of

from mpm_ref.plain.spline import pairs
from mpm_ref.store.results import BadResults, Results
from mpm_ref.store.vtkhdf import export_grid, export_particles
from mpm_ref.store.writer import StoredFields, create

ULP = 2.0**-23        # of single precision


def results_of(path, problem, fields=None, frames=3):
    writer = create(path, problem, fields or StoredFields(), {})
    for k in range(frames):
        writer.append(frame_of(state_of(problem, k), k), ENERGY)
    writer.close()
    return Results(path)


@pytest.fixture
def results(tmp_path, d):
    still = np.zeros(d)
    bodies = (block("left", (0.2, 0.5, 0.1)[:d], still, cells=2),
              block("water", (0.6, 0.5, 0.1)[:d], still, cells=1, fluid=True))
    problem = replace(colliding(), bodies=bodies, gravity=still)
    with results_of(tmp_path / "run.h5", problem) as results:
        yield results


def read_by_vtk(path):
    """(time, data set) of every frame, as VTK's own reader gives them."""
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF", reason="needs the extra viz (vtk)")
    reader = hdf.vtkHDFReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for k in range(reader.GetNumberOfSteps()):
        reader.SetStep(k)
        reader.Update()
        yield reader.GetTimeValue(), reader.GetOutput()


def array(data, name=None):
    """Point data, or with no name the points, as NumPy."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(data.GetPointData().GetArray(name) if name else data.GetPoints().GetData())


def both(results, name, frame):
    return np.concatenate([results.scalar(body, name, frame) for body in results.bodies])


def test_vtk_reads_the_particles_back(tmp_path, results, d):
    export_particles(results, tmp_path / "run.vtkhdf")
    frames = list(read_by_vtk(tmp_path / "run.vtkhdf"))
    assert len(frames) == len(results) == 3
    for k, (time, _) in enumerate(frames):
        assert time == results.time[k]
    for k, (_, data) in enumerate(read_by_vtk(tmp_path / "run.vtkhdf")):
        x, v = (np.concatenate([results.field(body, name, k) for body in results.bodies])
                for name in "xv")
        assert data.GetNumberOfVerts() == len(x)
        for ours, theirs in ((x, array(data)), (v, array(data, "v"))):
            np.testing.assert_allclose(theirs[:, :d], ours, rtol=ULP)
            assert not theirs[:, d:].any()
        np.testing.assert_allclose(array(data, "J"), both(results, "J", k), rtol=ULP, atol=ULP)
        np.testing.assert_allclose(array(data, "tau_norm"), both(results, "tau", k), rtol=ULP)
        np.testing.assert_array_equal(array(data, "body"), both(results, "body", k))


def test_only_what_is_stored_is_exported(tmp_path):
    with results_of(tmp_path / "run.h5", colliding(), StoredFields(("x", "F"))) as results:
        export_particles(results, tmp_path / "run.vtkhdf")
        with pytest.raises(BadResults, match="v of body 'left' is not stored"):
            export_grid(results, tmp_path / "grid.vtkhdf")
    with h5py.File(tmp_path / "run.vtkhdf") as h5:
        assert set(h5["VTKHDF/PointData"]) == {"J", "body"}
    assert not (tmp_path / "grid.vtkhdf").exists()


def test_vtk_reads_the_grid_back(tmp_path, results, d):
    export_grid(results, tmp_path / "grid.vtkhdf")
    frames = 0
    for k, (time, image) in enumerate(read_by_vtk(tmp_path / "grid.vtkhdf")):
        frames += 1
        assert time == results.time[k]
        assert image.GetSpacing() == (results.dx,) * 3
        density, velocity = array(image, "density"), array(image, "velocity")
        points = np.array([image.GetPoint(i) for i in range(image.GetNumberOfPoints())])
        m, x, v = (np.concatenate([results.field(body, *key) for body in results.bodies])
                   for key in (("m",), ("x", k), ("v", k)))
        # Mass, its first moment and momentum are those of the particles: so weights, places and
        # order of the nodes are right. Sums of single precision numbers.
        m_i = density.astype(float) * results.dx**d
        np.testing.assert_allclose(m_i.sum(), m.sum(), rtol=1e-6)
        np.testing.assert_allclose(m_i @ points[:, :d], m @ x, rtol=1e-6)
        np.testing.assert_allclose(m_i @ velocity[:, :d], m @ v, rtol=1e-6)
        assert not velocity[:, d:].any()
        near = np.abs(points[:, None, :d] - x).max(axis=2).min(axis=1) < 1.5 * results.dx
        np.testing.assert_array_equal(density > 0.0, near)
    assert frames == 3


@pytest.mark.parametrize("gimp", [0.0, 2.0])
def test_the_grid_has_the_weights_of_the_scheme(tmp_path, gimp):
    """The second moment of the mass, which differs between GIMP and quadratic splines."""
    problem = colliding()
    problem = replace(problem, scheme=replace(problem.scheme, transfer="pic", gimp=gimp))
    with results_of(tmp_path / "run.h5", problem, frames=1) as results:
        assert results.gimp == gimp
        export_grid(results, tmp_path / "grid.vtkhdf")
        x, m = (np.concatenate([results.field(body, *key) for body in results.bodies])
                for key in (("x", 0), ("m",)))
    with h5py.File(tmp_path / "grid.vtkhdf") as h5:
        root = h5["VTKHDF"]
        m_i = root["PointData/density"][0].astype(float).sum(axis=0) * problem.dx**2
        nodes = root.attrs["Origin"][0] + problem.dx * np.arange(len(m_i))
    ip = pairs(x, problem.dx, 2, gimp)
    expected = (m[:, None] * ip.w * (problem.dx * ip.node[..., 0]) ** 2).sum()
    assert m_i @ nodes**2 == pytest.approx(expected, rel=1e-6)      # of single precision


def test_frames_share_the_cells(tmp_path, results, d):
    export_particles(results, tmp_path / "run.vtkhdf")
    with h5py.File(tmp_path / "run.vtkhdf") as h5:
        root = h5["VTKHDF"]
        assert len(root["Vertices/Connectivity"]) == len(root["Points"]) // 3
        assert root["Steps/PointOffsets"][()].tolist() == [n * (4**d + 2**d) for n in range(3)]
        assert not root["Steps/CellOffsets"][()].any()


@pytest.mark.parametrize("export", [export_particles, export_grid])
def test_results_without_a_frame_are_told(tmp_path, export):
    with results_of(tmp_path / "run.h5", colliding(), frames=0) as results:
        with pytest.raises(BadResults, match="there is no frame 0; it has 0"):
            export(results, tmp_path / "run.vtkhdf")
