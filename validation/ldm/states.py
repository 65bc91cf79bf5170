"""What LDM's state figures show: reduced runs beside full-order ones, and their points at some
times.

The points are kept as ``results/<profile>/bodies/<id>.npz``, small enough to be published.
"""

import io
from typing import NamedTuple

import numpy as np
import threadpoolctl
from scipy.spatial import cKDTree

from mpm_ref.cases import in_order
from mpm_ref.reduced.case import case
from mpm_ref.reduced.errors import Errors, Squares
from mpm_ref.reduced.march import Way, march, picked
from mpm_ref.rom.samples import PER_GROUP
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..record import write_whole
from ..registry import experiment
from ..verification.scenes import threads_for
from .nets import trained
from .references import share
from .studies import POKES, TORSION, TOWER, fallen, leaning, poked, twisted
from .superres import FINE, REFINE, advected, fine

WAY = Way("lagrangian", "linear", 50)
ALL = WAY._replace(points=None)     # as the paper's Table 4
TRACKED = 4000              # points that errors are of, at most
BITS = 14                   # of a kept coordinate, after that of the largest
GRAVITIES = (1, 5, 10)      # [m/s^2], Figure 6
PULLED = TORSION.mu[TORSION.test[-1]]       # [m/s], [rad/s]
POKED = POKES.mu[POKES.test[0]]             # [rad]
# Figure 15: r [m/s], ten times what it prints (LDM-X9), theta and phi [rad]
LEANINGS = ((0.66, 1.386, -0.903), (0.75, 1.06, -0.537), (0.8, 0.403, -0.967),
            (0.62, 0.071, -0.765))


class Pair(NamedTuple):
    """A reduced run beside the full one."""

    X: np.ndarray           # (n, d) points at rest [m]
    reduced: np.ndarray     # (shots, n, d) positions [m]
    full: np.ndarray        # (shots, n, d)
    xhat: np.ndarray        # (k + 1, r) latent coordinates
    errors: Errors          # over all time levels
    scale: str              # how much it is, in words


def pair(scene, net, shots=None, shown=slice(None), way=WAY):
    """`Pair` of a scene on a trained map: positions of the points `shown` at the steps `shots`,
    None for all of them.
    """
    one, model = case(scene), trained(net)
    tracked = slice(None, None, -(-len(one.X) // TRACKED))
    place, sums, kept, xhat = model.decoder.place, Squares(one.X[tracked]), [], []
    with threads_for(one.problem.bodies), threadpoolctl.threadpool_limits(1):
        states = march(one, model.decoder, way, model.rest)
        for k, (x, (latent, _)) in enumerate(zip(positions(scene), states, strict=True)):
            sums.add(place(one.X[tracked], latent.xhat), x[tracked])
            xhat.append(latent.xhat)
            if shots is None or k in shots:
                kept.append((place(one.X[shown], latent.xhat), x[shown]))
    samples = f"{way.points} samples" if way.points else "all points"
    scale = f"{len(one.X)} particles, {scene.steps} steps, {samples}"
    return Pair(one.X[shown], *np.stack(kept, axis=1), np.array(xhat), sums.errors, scale)


def positions(scene):
    """Yield x (n, d) of a full-order run, points in the body's own order."""
    for frame in simulate(build(scene)):
        body = frame.state.bodies[0]
        yield in_order(body.particles.x, body.id)


def keep(run, **arrays):
    """Write named arrays of an experiment; those of floats rounded, in single precision."""
    text = io.BytesIO()
    np.savez_compressed(text, **{name: rounded(np.asarray(a)) for name, a in arrays.items()})
    write_whole(file_of(run.folder, run.experiment.id), text.getvalue())


def rounded(a):
    """Floats to so many `BITS`, as what is zero takes no room; other numbers as they are."""
    if a.dtype.kind != "f":
        return a
    unit = 2.0 ** (np.floor(np.log2(np.abs(a).max())) - BITS)
    return (np.round(a / unit) * unit).astype(np.float32)


def read(folder, id):
    """{name: array} of an experiment. Raises FileNotFoundError where they are not there."""
    file = file_of(folder, id)
    if not file.is_file():
        raise FileNotFoundError(f"no {file.name} in {file.parent}: run {id} again for it")
    with np.load(file) as arrays:
        return {name: arrays[name] for name in arrays.files}


def file_of(folder, id):
    """Where the arrays of an experiment stand."""
    return folder / "bodies" / f"{id}.npz"


@experiment("ldm.fig4", title="LDM: sample points of the tower",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def sampled(run):
    """Keeps all points and one draw of samples; records how many are near what is held."""
    one = case(TOWER.scene(*TOWER.mu[TOWER.test[0]]))
    model, held = trained("tower"), one.held(0.0)
    samples = picked(one, model.decoder, WAY, model.rest, run.seed)(0.0)
    counts = [int(np.isin(samples, near).sum()) for near in held]
    scale = f"{len(one.X)} particles"
    keep(run, X=one.X, samples=samples, held=np.array([np.isin(samples, near) for near in held]))
    run.record("ldm.fig4.points_sample", len(samples), scale=scale)
    run.record("ldm.fig4.points_all", len(one.X), scale=scale, comparator="info",
               note="on the grid of the training runs")
    run.record("ldm.fig4.held", min(counts), unit="1", scale=scale, comparator=">=",
               bound=PER_GROUP, note=f"samples near the bottom and the top: {counts}, the fewer")


@experiment("ldm.fig6", title="LDM: the cylinder under three gravities",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def gravities(run):
    """Keeps the ends of reduced runs, r = 7."""
    last = {fallen(1.0).steps}
    found = {g: pair(fallen(g), "gravity-r7", last) for g in run.progress(GRAVITIES, "gravity")}
    for g, one in found.items():
        scale = f"{one.scale}, one run"
        run.record(f"ldm.fig6.gravity.{g}", g, scale=scale)
        share(run, f"ldm.fig6.error.g{g}", one.errors, scale, comparator="info")
    keep(run, X=one.X, g=GRAVITIES, reduced=[one.reduced[0] for one in found.values()],
         full=[one.full[0] for one in found.values()])


@experiment("ldm.fig11", title="LDM: a block pulled and twisted",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def torsion(run):
    """Keeps the end of a test run."""
    scene = twisted(*PULLED)
    one = pair(scene, "torsion-0", {scene.steps})
    share(run, "ldm.fig11.error", one.errors, f"{one.scale}, {of_torsion()}", comparator="info")
    keep(run, X=one.X, reduced=one.reduced[0], full=one.full[0])


def of_torsion():
    """Which test run of torsion is shown."""
    v, w = PULLED
    return f"the test run of {v:.3g} m/s and {w:.3g} rad/s"


@experiment("ldm.fig12", title="LDM: a test run with more points than it was trained on",
            profiles=("standard",), budget={"standard": 40})
def superresolution(run):
    """Keeps the ends of the four runs; records errors of the reduced one, with all points and with
    a few, and of the tracers.
    """
    low, high = twisted(*PULLED), fine(*PULLED)
    one = pair(high, "torsion-0", range(0, high.steps + 1, REFINE), way=ALL)
    sparse = pair(high, "torsion-0", {high.steps})
    tracers, few = advected(low, one.X), list(positions(low))[-1]
    sums = Squares(one.X)
    for x, reference in zip(tracers, one.full, strict=True):
        sums.add(x, reference)
    scale = f"{one.scale}, {of_torsion()}"
    share(run, "ldm.fig12.reduced_high", one.errors, scale)
    share(run, f"ldm.fig12.reduced_high.{WAY.points}", sparse.errors,
          f"{sparse.scale}, {of_torsion()}", comparator="info")
    share(run, "ldm.fig12.baseline", sums.errors, scale, f"{low.steps} steps of {len(few)} points")
    for name, value in (("low_points", len(few)), ("high_points", FINE), ("refine", REFINE)):
        run.record(f"ldm.fig12.{name}", value, scale=scale)
    keep(run, tracers=tracers[-1], low=few, reduced=one.reduced[-1], full=one.full[-1])


@experiment("ldm.fig13", title="LDM: a cylinder poked, and its latent trajectory",
            profiles=("standard",), budget={"standard": 40})
def poke(run):
    """Keeps three states of a test run; its latent states in the plane of their first two
    principal components (Figure 14).
    """
    scene = poked(*POKED)
    one = pair(scene, "poke")
    shots = [0, round(scene.fixed[1].until / scene.dt), scene.steps]
    scale = f"{one.scale}, the test run of {np.degrees(POKED[0]):.0f} degrees"
    plane, spread = components(one.xhat)
    share(run, "ldm.fig13.error", one.errors, scale, comparator="info")
    run.record("ldm.fig14.return", returned(one.xhat), unit="1", scale=scale, comparator="info",
               note="distance of the last latent state from the first, over the largest; "
               f"of the body's points {returned(one.reduced):.3g}, in the full run "
               f"{returned(one.full):.3g}")
    run.record("ldm.fig14.plane", spread, unit="1", scale=scale, comparator="info",
               note="share of the variance of the latent states in that plane")
    run.table("latent", ("step", "t", "pc1", "pc2", "driven"),
              [(k, k * scene.dt, *place, int(k <= shots[1])) for k, place in enumerate(plane)])
    keep(run, X=one.X, t=scene.dt * np.array(shots), reduced=one.reduced[shots],
         full=one.full[shots])


def components(xhat):
    """Latent states xhat (k + 1, r) in the plane of their first two principal components, (k + 1,
    2), each with its longest arm positive; and the share of their variance in it.
    """
    U, s, _ = np.linalg.svd(xhat - xhat.mean(axis=0), full_matrices=False)
    plane = U[:, :2] * s[:2]
    longest = plane[np.abs(plane).argmax(axis=0), (0, 1)]
    return plane * np.sign(longest), float(np.sum(s[:2] ** 2) / np.sum(s**2))


def returned(a):
    """Distance of the last of states a (k + 1, ..) from the first, over the largest: 0 where it has
    come back.
    """
    away = np.linalg.norm((a - a[0]).reshape(len(a), -1), axis=1)
    return float(away[-1] / away.max())


@experiment("ldm.fig15", title="LDM: four test runs of the tower",
            profiles=("standard",), budget={"standard": 150})
def tower(run):
    """Keeps the outermost points at three times, reduced and full."""
    scene = leaning(*LEANINGS[0])
    shots, shown = (0, scene.steps // 2, scene.steps), skin(case(scene).X)
    found = [pair(leaning(*mu), "tower", shots, shown)
             for mu in run.progress(LEANINGS, "runs")]
    for k, (one, mu) in enumerate(zip(found, LEANINGS, strict=True), 1):
        scale = f"{one.scale}, one run"
        share(run, f"ldm.fig15.error.{k}", one.errors, scale, comparator="info")
        of_row(run, f"ldm.fig15.row{k}", mu, scale)
    times = scene.dt * np.array(shots)
    for name, t in zip(("0.0", "1.67", "3.33"), times, strict=True):
        run.record(f"ldm.fig15.t.{name}", t, scale=found[0].scale, tolerance=0.005)
    keep(run, X=found[0].X, t=times, mu=LEANINGS, reduced=[one.reduced[1:] for one in found],
         full=[one.full[1:] for one in found])


def of_row(run, name, mu, scale):
    """Record the parameters of a row of Figure 15."""
    r, theta, phi = mu
    run.record(f"{name}.r", r, scale=scale, comparator="info",
               note="ten times what is printed (LDM-X9)")
    run.record(f"{name}.theta", theta, scale=scale)
    run.record(f"{name}.phi", phi, scale=scale)


def skin(X):
    """Numbers of the points of a regular sampling X (n, 3) that are outermost or next to these; of
    them every other one, as on a chessboard.
    """
    tree = cKDTree(X)
    h = tree.query(X[0], 2)[0][1]
    few = tree.query_ball_point(X, 2.1 * h, return_length=True) < 33
    return np.flatnonzero(few & (np.round((X - X[0]) / h).sum(axis=1) % 2 == 0))
