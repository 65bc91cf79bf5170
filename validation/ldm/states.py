"""Points of reduced and full-order runs at some times, for LDM's figures of states."""

from math import asin, atan2

import numpy as np
from scipy.spatial import cKDTree

from mpm_ref.rom.sampling import PER_GROUP
from mpm_ref.rom.study.full_model import ldm_full_model, prescribed_regions
from mpm_ref.rom.study.samples import ldm_sampler

from ..common.registry import experiment
from .networks import trained
from .paired_runs import ALL, SHOWN, pair, position_errors, positions
from .published_bodies import keep
from .references import record_errors
from .studies import POKES, TORSION, TOWER, fallen, leaning, poked, twisted
from .superres import REFINE, advected, fine

GRAVITIES = (1, 5, 10)      # [m/s^2], Figure 6
PULLED = TORSION.mu[TORSION.test[-1]]       # [m/s], [rad/s]
POKED = POKES.mu[POKES.test[0]]             # [rad]
# Figure 15: r [m/s], ten times what it prints (LDM-X9), theta and phi [rad]
LEANINGS = ((0.66, 1.386, -0.903), (0.75, 1.06, -0.537), (0.8, 0.403, -0.967),
            (0.62, 0.071, -0.765))


@experiment("ldm.fig4", title="LDM: sample points of the tower",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def sampled(run):
    """Keeps all points and one draw of samples; records how many are near what is held."""
    one = ldm_full_model(TOWER.scene(*TOWER.mu[TOWER.test[0]]))
    model, held = trained("tower"), one.constrained_points(0.0)
    sampler = ldm_sampler(one, model.field, SHOWN, model.rest, run.seed)
    samples = sampler(0.0, None).points
    counts = [int(np.isin(samples, near).sum()) for near in held]
    scale = f"{len(one.X)} particles"
    keep(run, X=one.X, samples=samples, held=np.array([np.isin(samples, near) for near in held]))
    run.record("ldm.fig4.points_sample", len(np.unique(samples)), scale=scale)
    run.record("ldm.fig4.points_all.small", len(one.X), scale=scale,
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
        gravity = one.full_model.problem.gravity
        run.record(f"ldm.fig6.gravity.{g}", np.linalg.norm(gravity), scale=scale)
        record_errors(run, f"ldm.fig6.error.g{g}", one.errors, scale, comparator="info")
    keep(run, X=one.X, g=GRAVITIES, reduced=[one.reduced[0] for one in found.values()],
         full=[one.full[0] for one in found.values()])


@experiment("ldm.fig11", title="LDM: a block pulled and twisted",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def torsion(run):
    """Keeps the end of a test run."""
    scene = twisted(*PULLED)
    one = pair(scene, "torsion-0", {scene.steps})
    record_errors(run, "ldm.fig11.error", one.errors, f"{one.scale}, {torsion_label()}",
                  comparator="info")
    keep(run, X=one.X, reduced=one.reduced[0], full=one.full[0])


def torsion_label():
    """Describe the test run of torsion that is shown."""
    v, w = PULLED
    return f"the test run of {v:.3g} m/s and {w:.3g} rad/s"


@experiment("ldm.fig12", title="LDM: a test run with more points than it was trained on",
            profiles=("standard",), budget={"standard": 40})
def superresolution(run):
    """Keeps the ends of the four runs; records errors of the reduced one, with all points and with
    a few, and of the tracers.
    """
    low, high = twisted(*PULLED), fine(*PULLED)
    levels = range(0, high.steps + 1, REFINE)
    one, sparse = (pair(high, "torsion-0", levels, options=options) for options in (ALL, SHOWN))
    tracers, few = advected(low, one.X), list(positions(low))[-1]
    every, sparse_errors, baseline = (position_errors(one.X, x, one.full)
                                      for x in (one.reduced, sparse.reduced, tracers))
    extent = f"errors of {len(one.X)} points at {len(tracers)} times, {torsion_label()}"
    scale = f"{one.size}, {extent}"
    record_errors(run, "ldm.fig12.reduced_high", every, scale)
    record_errors(run, f"ldm.fig12.reduced_high.{sparse.samples}", sparse_errors,
                  f"{sparse.size}, {extent}", comparator="info")
    record_errors(run, "ldm.fig12.baseline", baseline, scale,
                  f"tracers in our {low.steps} steps of "
                  f"{len(few)} points; the reduced run has to beat it, see ldm.fig12.gain")
    run.record("ldm.fig12.gain", baseline.origin / every.origin, unit="x", scale=scale,
               comparator=">=", bound=1.0, note="the tracers' error over that of the reduced run")
    for name, value in (("low_points", len(few)), ("high_points", len(one.full_model.X)),
                        ("refine", low.dx / one.full_model.problem.dx)):
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
    record_errors(run, "ldm.fig13.error", one.errors, scale, comparator="info")
    run.record("ldm.fig14.return", return_distance(one.xhat), unit="1", scale=scale,
               comparator="info",
               note="distance of the last latent state from the first, over the largest; "
               f"of the body's points {return_distance(one.reduced):.3g}, in the full run "
               f"{return_distance(one.full):.3g}")
    run.record("ldm.fig14.plane", spread, unit="1", scale=scale, comparator="info",
               note="share of the variance of the latent states in that plane")
    run.table("latent", ("step", "t", "pc1", "pc2", "driven"),
              [(k, k * scene.dt, *place, int(k <= shots[1])) for k, place in enumerate(plane)])
    keep(run, X=one.X, t=scene.dt * np.array(shots), reduced=one.reduced[shots],
         full=one.full[shots])


def components(xhat):
    """Return latent states xhat (k + 1, r) in the plane of their first two principal components, (k
    + 1, 2), each with its longest arm positive; and the share of their variance in it.
    """
    U, s, _ = np.linalg.svd(xhat - xhat.mean(axis=0), full_matrices=False)
    plane = U[:, :2] * s[:2]
    longest = plane[np.abs(plane).argmax(axis=0), (0, 1)]
    return plane * np.sign(longest), float(np.sum(s[:2] ** 2) / np.sum(s**2))


def return_distance(a):
    """Return the distance of the last of states a (k + 1, ..) from the first over the largest: 0
    where the body has come back.
    """
    distances = np.linalg.norm((a - a[0]).reshape(len(a), -1), axis=1)
    return float(distances[-1] / distances.max())


@experiment("ldm.fig15", title="LDM: four test runs of the tower",
            profiles=("standard",), budget={"standard": 150})
def tower(run):
    """Keeps the outermost points at three times, reduced and full."""
    scene = leaning(*LEANINGS[0])
    shots, shown = (0, scene.steps // 2, scene.steps), skin(ldm_full_model(scene).X)
    found = [pair(leaning(*mu), "tower", shots, shown)
             for mu in run.progress(LEANINGS, "runs")]
    mu = [drive_parameters(one.full_model) for one in found]
    for k, one in enumerate(found):
        scale = f"{one.scale}, one run"
        record_errors(run, f"ldm.fig15.error.{k + 1}", one.errors, scale, comparator="info")
        record_row(run, f"ldm.fig15.row{k + 1}", mu[k], scale)
    run.record("ldm.sec5_4.fig15_points", max(one.samples for one in found), scale=found[0].scale)
    times = scene.dt * np.array(shots)
    for name, t in zip(("0.0", "1.67", "3.33"), times, strict=True):
        run.record(f"ldm.fig15.t.{name}", t, scale=found[0].scale)
    keep(run, X=found[0].X, t=times, mu=mu, reduced=[one.reduced[1:] for one in found],
         full=[one.full[1:] for one in found])


def drive_parameters(one):
    """Return r [m/s], theta and phi [rad] of the last region that a `FullModel` drives, from its
    mean velocity r (cos phi cos theta, cos phi sin theta, sin phi).
    """
    clock, motion = one.problem.clock, prescribed_regions(one.problem)[-1].motion
    end = clock.steps * clock.dt
    v = motion.pose(end, end, one.problem.dim).v[0]
    r = float(np.linalg.norm(v))
    return r, atan2(v[1], v[0]), asin(v[2] / r)


def record_row(run, name, mu, scale):
    """Record the parameters of a row of Figure 15."""
    r, theta, phi = mu
    run.record(f"{name}.r", r, scale=scale, note="ten times what is printed (LDM-X9)")
    run.record(f"{name}.theta", theta, scale=scale)
    run.record(f"{name}.phi", phi, scale=scale)


def skin(X):
    """Return the numbers of the points of a regular sampling X (n, 3) that are outermost or next to
    these; of them every other one, as on a chessboard.
    """
    tree = cKDTree(X)
    h = tree.query(X[0], 2)[0][1]
    few = tree.query_ball_point(X, 2.1 * h, return_length=True) < 33
    return np.flatnonzero(few & (np.round((X - X[0]) / h).sum(axis=1) % 2 == 0))
