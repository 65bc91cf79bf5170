"""Files of runs whose particles enter and leave."""

import h5py
import numpy as np
import pytest
from stream_scenes import gravity, problem, sink

from mpm_ref.plotting import draw, particles
from mpm_ref.simulate import simulate
from mpm_ref.store.checkpoint import digest
from mpm_ref.store.results import Results
from mpm_ref.store.running import Options, run
from mpm_ref.store.vtkhdf import export_grid, export_particles

CLOCKS = {"explicit": "end = 0.4\ninterval = 0.04",
          "implicit": 'integrator = "hot"\nlongest = 0.02\nend = 0.4\ninterval = 0.04'}
SWAY = "sway = {{ amplitude = {}, frequency = {} }}"


def jet(d=2, clock="explicit", source=""):
    """A stream that falls into a sink before it ends."""
    return problem(d, source, CLOCKS[clock] + "\n" + gravity(d), sink(d))


@pytest.fixture(scope="module", params=[2, 3])
def results(request, tmp_path_factory):
    out = tmp_path_factory.mktemp("jet") / "run.h5"
    run(jet(request.param, source="stop = 0.15"), out)
    with Results(out) as results:
        yield results


def test_frames_hold_the_particles_that_are_there(results):
    """Row p is the particle of number p, NaN where it is not in the run."""
    one = jet(results.dim, source="stop = 0.15")
    counts, n = [], one.sources[0].particles
    for frame in simulate(one):
        (body,) = frame.state.bodies
        there = results.present("jet", frame.index)
        assert np.array_equal(np.flatnonzero(there), np.sort(body.id))
        for name in ("x", "v", "F", "tau"):
            stored = results.field("jet", name, frame.index)
            assert stored.shape == (n, *getattr(body.particles, name).shape[1:])
            assert np.array_equal(stored[body.id], getattr(body.particles, name))
            assert np.isnan(stored[~there]).all()
        assert results.field("jet", "m")[there].sum() == pytest.approx(body.particles.m.sum())
        counts.append(len(body.id))
    assert counts[0] < max(counts)
    assert counts[-1] < max(counts) <= n == results.count("jet") == len(results.field("jet", "V0"))
    assert len(results) == 11


@pytest.mark.parametrize("name", ["speed", "J", "tau", "pressure", "body"])
def test_scalars_are_those_of_particles_that_are_there(results, name):
    for k in range(len(results)):
        there = results.present("jet", k)
        value = results.scalar("jet", name, k)
        assert value.shape == there.shape
        assert np.isfinite(value[there]).all()
        assert name == "body" or np.isnan(value[~there]).all()


def test_pictures_show_the_particles_that_are_there(results):
    for k in (0, 5, len(results) - 1):
        dots = particles(draw(results, k, "body").axes[0])
        assert len(dots.get_offsets()) == len(dots.get_array()) == results.present("jet", k).sum()


def test_a_source_that_sways_is_drawn_where_its_last_block_entered(tmp_path):
    """Frames lie between the entries, at t = 0, 0.1, 0.2 s."""
    source = SWAY.format([0.3, 0.0], [1.0, 0.0])
    run(problem(2, source, "end = 0.25\ninterval = 0.05"), tmp_path / "run.h5")
    with Results(tmp_path / "run.h5") as results:
        for frame, entry in ((1, 0.0), (3, 0.1), (5, 0.2)):
            drawn = draw(results, frame).axes[0].collections
            (line,) = [one.get_paths()[0].vertices for one in drawn
                       if hasattr(one, "filled") and not one.filled]
            x = 0.3 * np.sin(2.0 * np.pi * entry) + np.array([0.5, 0.6])
            assert [line[:, 0].min(), line[:, 0].max()] == pytest.approx(x, abs=2e-3)


def test_exports_have_the_particles_that_are_there(results, tmp_path):
    export_particles(results, tmp_path / "run.vtkhdf")
    counts = [int(results.present("jet", k).sum()) for k in range(len(results))]
    with h5py.File(tmp_path / "run.vtkhdf") as h5:
        root = h5["VTKHDF"]
        assert root["NumberOfPoints"][()].tolist() == counts
        assert root["Vertices/NumberOfCells"][()].tolist() == counts
        starts = root["Steps/PointOffsets"][()]
        assert starts.tolist() == np.cumsum([0, *counts[:-1]]).tolist()
        assert root["Steps/PartOffsets"][()].tolist() == list(range(len(counts)))
        for k, (a, n) in enumerate(zip(starts, counts, strict=True)):
            x = results.field("jet", "x", k)[results.present("jet", k)]
            assert root["Points"][a:a + n, :results.dim] == pytest.approx(x, rel=1e-6)
            v = results.field("jet", "v", k)[results.present("jet", k)]
            assert root["PointData/v"][a:a + n, :results.dim] == pytest.approx(v, rel=1e-6)
            assert root["Vertices/Connectivity"][a:a + n].tolist() == list(range(n))
            assert root["Vertices/Offsets"][a + k:a + k + n + 1].tolist() == list(range(n + 1))
        assert not np.isnan(root["Points"][()]).any()


def test_vtk_reads_frames_of_different_sizes(results, tmp_path):
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF", reason="needs the extra viz (vtk)")
    export_particles(results, tmp_path / "run.vtkhdf")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "run.vtkhdf"))
    reader.UpdateInformation()
    for k in range(len(results)):
        reader.SetStep(k)
        reader.Update()
        data, n = reader.GetOutput(), results.present("jet", k).sum()
        assert data.GetNumberOfPoints() == data.GetNumberOfVerts() == n
        x = results.field("jet", "x", k)[results.present("jet", k)]
        for p in {0, n - 1} if n else ():
            assert data.GetPoint(p)[:results.dim] == pytest.approx(x[p], rel=1e-6)


def test_grids_have_the_mass_of_the_particles_that_are_there(results, tmp_path):
    export_grid(results, tmp_path / "grid.vtkhdf")
    with h5py.File(tmp_path / "grid.vtkhdf") as h5:
        density = h5["VTKHDF/PointData/density"]
        for k in range(len(results)):
            mass = results.field("jet", "m")[results.present("jet", k)].sum()
            assert density[k].astype(float).sum() * results.dx**results.dim == pytest.approx(mass)


def test_an_empty_frame_is_stored_drawn_and_exported(tmp_path):
    one = problem(2, "stop = 0.05", "end = 0.6\ninterval = 0.1\n" + gravity(), sink())
    run(one, tmp_path / "run.h5")
    with Results(tmp_path / "run.h5") as results:
        assert not results.present("jet", -1).any()
        assert (results.energy[-1] == 0.0).all()
        draw(results, -1)
        export_particles(results, tmp_path / "run.vtkhdf")
        export_grid(results, tmp_path / "grid.vtkhdf")
    with h5py.File(tmp_path / "grid.vtkhdf") as h5:
        assert not h5["VTKHDF/PointData/density"][-1].any()


@pytest.mark.parametrize("source", ["", SWAY])
@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_run_in_parts_is_the_run(tmp_path, d, clock, source):
    """Stopped before, between and after entries and removals: the same bits in all files."""
    source = source.format(*(str(a[:d]) for a in ([0.3, 0.0, -0.2], [1.0, 0.0, 1.5])))
    whole = run(jet(d, clock, source), tmp_path / "whole.h5")
    out, step = tmp_path / "parts.h5", whole.state.step
    for stop in range(1, step, max(step // 9, 1)):
        run(jet(d, clock, source), out, Options(steps=stop, resume=stop > 1))
    rest = run(jet(d, clock, source), out, Options(resume=True))
    assert digest(rest.state) == digest(whole.state)
    with Results(tmp_path / "whole.h5") as a, Results(out) as b:
        assert np.array_equal(a.step, b.step)
        assert np.array_equal(a.energy, b.energy)
        for name in ("x", "v", "F", "tau", "m", "V0"):
            assert np.array_equal(a.field("jet", name), b.field("jet", name), equal_nan=True)
