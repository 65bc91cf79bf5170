"""Monitor of a reduced run: it detects that the run has left the training data of its model, or
that no body is left.

No reduced step fails where the model extrapolates: the run continues, smooth and wrong. This shows
in each state, at a few points and in the report of the step:

    beyond      distance of the latent coordinates from the trained ones (`rom.extrapolation`)
    off         distance of the samples from the map's states after the step, in cells: due to
                forces that the map cannot follow, and to long time steps. At the start, distance
                of the body from its place at rest: due to a map of another body
    coverage    share of each motion of the body in the motion of the samples of the last steps:
                low for too few samples, or samples in one place
    blind       number of latent coordinates that the samples do not determine
    lost        quadrature points that could not be traced back into the body
    inverted    points with det F <= 0
    spread      standard deviation of the samples' places over that of the body's, along the axis
                of the body where it is least: low for samples in one place
    departure   distance of states and steps from those of the training runs
                (`rom.extrapolation.Paths`), as a root mean square over the run so far; in LDM over
                `coverage` and `spread`, since that share of it shows

In LDM `departure` is the rule for runs that go wrong among trained states: with few samples,
samples in one place, or longer steps. `coverage` and `spread` have no bounds of their own, and
`off` has one at the start alone. The bounds of `departure` are quantiles of calibration runs
(`extremes.ldm.bound`, `extremes.nsf.bound`), which are not those that the other experiments of
`extremes` judge them by. A run with inferred stress is checked for `beyond`, `blind` and
`departure`, and for `coverage` by the latent coordinates' modes, FIELD_COVERAGE; the coverage of
samples with weights is not, as their weights make up for it.
"""

from typing import NamedTuple

import numpy as np

from ..cubature import misfit
from ..extrapolation import BEYOND, Extent, Paths, evenly, trained_extent, trained_paths
from ..fields.pod_fields import PodFields
from ..integrity import require_intact, seal
from ..projection import RANK

CHECKED = 64        # points of the body that are checked, and samples
OFF = 0.033         # [dx] at the start
DEPARTURE = 4.5     # of LDM; 8 % of the wrong calibration runs are below, 10 % of the good above
FIELD_DEPARTURE = 0.8       # of NSF; 6 % and 5 %
FIELD_COVERAGE = 0.15       # from random samples and samples in corners of the jelly cube and frame
MEMORY = 0.8        # share of the earlier coverage in the present one: a poor draw is forgiven
LOST = 0.01         # of the quadrature points; in range none
NONSENSE = 0.1      # of the points checked; more that are inverted are no body,
NOWHERE = 100.0     # nor are latent coordinates this many times as far from the trained mean as any
                    # trained ones
SPARSE = 0.74       # of `rom.cubature.misfit`, from runs of jelly cube and metal frame

MESSAGES = {
    "beyond": "the latent coordinates are {beyond:.3g} times as far from the training runs as "
              "these are from each other",
    "off": "the map's states are {off:.2g} cells from the body at rest",
    "coverage": "of some motion of the body the samples saw only {coverage:.0%}",
    "blind": "{blind} of the latent coordinates could not be told from the samples",
    "lost": "{lost:.1%} of the quadrature points could not be traced back",
    "inverted": "{inverted:.1%} of the points looked at are inverted, det F down to {J:.3g}",
    "departure": "states and steps are {departure:.3g} times as far from those of the training "
                 "runs as these are from each other, above {most_departure:g}: take more samples, "
                 "steps as long as in training, or parameters nearer to the training's",
}


class NoBodyLeft(RuntimeError):
    """A reduced run in which no body is left."""


class StateCheck(NamedTuple):
    """Measures of a state of a reduced run; those that are not computed are within bounds."""

    beyond: float           # distance of xhat from the trained ones, over their largest gap
    blind: int              # r less the rank of dg/dxhat at the samples
    off: float = 0.0        # rms distance from the map's states that the step was projected over
                            # [dx]
    coverage: float = 1.0   # rms motion of the samples over that of the body, in the direction of
                            # xhat where it is least; a mean over the last steps
    lost: float = 0.0       # share of quadrature points that were not traced back
    J: float = np.nan       # smallest det F of the points checked
    inverted: float = 0.0   # share of them whose det F is not above 0
    far: float = 0.0        # distance of xhat from the mean of the trained ones, over their largest
    spread: float = 1.0     # of the samples over that of the body, where it is least; a mean over
                            # the last steps
    departure: float = 0.0  # rms distance of states and steps from the training runs', over their
                            # largest gap; in LDM over coverage and spread
    least_coverage: float = 0.0         # that is within bounds
    most_departure: float = DEPARTURE   # likewise
    sum_squares: float = 0.0        # of the distances so far
    steps: int = 0                  # in that sum
    most_off: float = np.inf        # that is within bounds

    @property
    def nonsense(self):
        """The reason why there is no body, in words; "" where there is one."""
        if self.inverted > NONSENSE:
            return f"{self.inverted:.0%} of the points looked at have no det F > 0"
        if self.far > NOWHERE:
            return (f"the latent coordinates are {self.far:.3g} times as far from the trained mean "
                    "as any trained ones")
        return ""

    @property
    def out_of_bounds(self):
        """Names of the measures that are out of bounds."""
        out = {"beyond": not self.beyond <= BEYOND, "off": not self.off <= self.most_off,
               "coverage": not self.coverage >= self.least_coverage, "blind": self.blind > 0,
               "lost": not self.lost <= LOST, "inverted": self.inverted > 0.0,
               "departure": not self.departure <= self.most_departure}
        return tuple(name for name, is_out in out.items() if is_out)

    @property
    def message(self):
        """The measures that are out of bounds, in words."""
        return "; ".join(MESSAGES[name].format(**self._asdict()) for name in self.out_of_bounds)


def stored_check(rows, k):
    """Return the `StateCheck` of frame k, as far as the rows of a results file have it; at the
    start nothing was sampled.
    """
    blind = rows["xhat"].shape[1] - int(rows["rank"][k]) if k else 0
    check = StateCheck(float(rows["beyond"][k]), blind, departure=float(rows["departure"][k]))
    if "lost" not in rows:
        return check._replace(most_departure=FIELD_DEPARTURE)
    points, lost = int(rows["points"][k]), int(rows["lost"][k])
    return check._replace(lost=lost / max(points + lost, 1), J=1.0, most_off=np.inf if k else OFF,
                          **{name: float(rows[name][k]) for name in ("off", "coverage",
                                                                     "inverted")})


class MapMonitor(NamedTuple):
    """The monitor of a run of LDM."""

    g: object               # the map
    X: np.ndarray           # (n, d) points that are checked, at rest [m]
    extent: Extent          # of the training latents
    dx: float               # of the grid [m]
    dt: float               # [s]
    all_points: np.ndarray  # (N, d) of which samples have numbers, at rest [m]
    axes: np.ndarray        # of the body's extent (see `principal_axes`)
    seal: dict              # of the map (see `rom.integrity`)
    paths: Paths | None = None      # of the training runs
    numbers: np.ndarray | None = None       # (N,) of all points, by which the map of several bodies
                                            # takes them; None: by their places at rest

    @property
    def field(self):
        """Return the map of the run."""
        return self.g

    @property
    def checked(self):
        """The points that are checked, as the map takes them."""
        return self.X if self.numbers is None else evenly(self.numbers, CHECKED)

    def check(self, state, last=None):
        """Return the `StateCheck` of a `RunState`, whose predecessor's was `last`; raises
        `NoBodyLeft`. It costs derivatives at CHECKED points, and at that many samples.
        """
        latent, report = state.latent, state.report
        with np.errstate(all="ignore"):
            x, F, G = self.g.derivatives(self.checked, latent.xhat)
            J = np.linalg.det(F)
            off = float(np.sqrt(np.mean(np.sum((x - self.X) ** 2, axis=1))))
        measures = {"off": off / self.dx, "blind": 0, "most_off": OFF}
        if report is not None:
            lost = report.quadrature.get("lost", 0)
            samples = state.samples.points
            X_samples = self.all_points[samples]
            some = evenly(X_samples if self.numbers is None else samples, CHECKED)
            shown = coverage(G, self.g.derivatives(some, latent.xhat)[2])
            spread_now = spread(X_samples, self.axes)
            measures = {"off": report.residual * self.dt / self.dx,
                        "coverage": MEMORY * last.coverage + (1.0 - MEMORY) * shown,
                        "blind": self.g.r - report.rank, "lost": lost / (lost + report.points),
                        "spread": MEMORY * last.spread + (1.0 - MEMORY) * spread_now}
            strayed = departed(self.paths, latent, last)
            shown = measures["coverage"] * measures["spread"]
            measures |= strayed | {"departure": strayed["departure"] / shown if shown else np.inf}
        return StateCheck(float(self.extent.beyond(latent.xhat)), J=float(J.min()),
                          inverted=float(np.mean(~(J > 0.0))),
                          far=float(self.extent.outlying(latent.xhat)), **measures)

    def describe(self, latent):
        """Return the place of the smallest det F of a state without body, in words."""
        with np.errstate(all="ignore"):
            J = np.linalg.det(self.g.derivatives(self.checked, latent.xhat)[1])
        p = int(np.argmin(np.where(np.isfinite(J), J, -np.inf)))
        place = ", ".join(f"{a:.3g}" for a in self.X[p])
        return f"det F is least at X = {place} m, {float(J[p]):.3g}"


class FieldMonitor(NamedTuple):
    """The monitor of a run of NSF."""

    extent: Extent      # of the training latents
    moving: np.ndarray  # see `modes_of_motion`; () of fields without modes
    field: object       # of the run
    seal: dict          # of the field (see `rom.integrity`)
    paths: Paths | None = None      # of the training runs

    def check(self, state, last=None):
        """Return the `StateCheck` of a `RunState`, whose predecessor's was `last`."""
        latent, report = state.latent, state.report
        blind = 0 if report is None else len(latent.xhat) - report.rank
        check = StateCheck(float(self.extent.beyond(latent.xhat)), blind,
                           least_coverage=FIELD_COVERAGE, most_departure=FIELD_DEPARTURE,
                           **departed(self.paths, latent, last))
        if report is None or not len(self.moving) or state.samples.weights is not None:
            return check
        U = latent_modes(self.field, state.samples.points)
        return check._replace(coverage=share_of_motion(U, self.moving))


def map_monitor(full, g, xhat):
    """Return the `MapMonitor` of runs of a `FullModel` on a map with training latents xhat (s,
    k + 1, r). Raises ValueError where these do not differ.
    """
    X, problem = evenly(full.X, CHECKED), full.problem
    inside = trained_extent(g, full.map_points, xhat)
    numbers = full.map_points if len(full.bodies) > 1 else None
    return MapMonitor(g, X, inside, problem.dx, problem.clock.dt, full.X, principal_axes(full.X),
                      seal(g), trained_paths(inside, xhat), numbers)


def field_monitor(fields, xhat, spacing=1.0):
    """Return the `FieldMonitor` of runs on fields with training latents xhat (s, k + 1, r), which
    are `spacing` steps of a run apart. Raises ValueError where these do not differ.
    """
    points = np.arange(len(fields.X))
    moving = (modes_of_motion(latent_modes(fields, points)) if isinstance(fields, PodFields)
              else np.zeros((0, 0)))
    inside = trained_extent(fields, points, xhat)
    return FieldMonitor(inside, moving, fields, seal(fields),
                        trained_paths(inside, xhat, spacing))


def departed(paths, latent, last):
    """Return {field of a `StateCheck`: value} of the `Paths` of the training, for a `Latent` after
    the state whose check was `last`; {"departure": 0} at the start, and without paths.
    """
    if paths is None or latent.before is None:
        return {"departure": 0.0}
    sum_squares, steps = (last.sum_squares, last.steps) if last else (0.0, 0)
    sum_squares += paths.distance(latent.before, latent.xhat) ** 2
    steps += 1
    return {"departure": float(np.sqrt(sum_squares / steps)), "sum_squares": sum_squares,
            "steps": steps}


def checked_states(run, monitor, earlier=()):
    """Yield (`RunState`, `StateCheck`) of a `ReducedRun`, of earlier states too (see
    `ReducedRun.states`). Raises `NoBodyLeft`, after the last state `integrity.DamagedModel` if
    arrays of the model have changed meanwhile, and what the run raises.
    """
    check, first = None, None
    for k, state in enumerate(run.states(earlier)):
        check = monitor.check(state, check)
        first = first or ((k, check) if check.out_of_bounds else None)
        if check.nonsense:
            raise NoBodyLeft(
                f"step {k}, t = {k * run.dt:.6g} s: no body is left, {check.nonsense}; "
                f"{monitor.describe(state.latent)}; out of bounds since step {first[0]}: "
                f"{first[1].message}. Keep to the parameters that the map was trained with, take "
                "more samples or a smaller dt")
        yield state, check
    require_intact(monitor.field, monitor.seal)


def sample_warnings(fields, samples):
    """Yield the warning, before a run, about a `SampleSet` that determines too little. Networks
    have no modes: their samples are not judged.
    """
    left, points = samples.misfit, samples.points       # of weights; NaN without
    if samples.weights is None and isinstance(fields, PodFields):
        left = misfit(fields.U, fields.r, points)
    if left > SPARSE:
        yield (f"the {len(points)} samples leave {100.0 * left:.0f} % of the products of the "
               f"modes, and most runs whose samples left more than {100.0 * SPARSE:.0f} % went "
               "wrong (docs/howto/reduced-model.md); give [run] more of them, or another seed")


def latent_modes(fields, points):
    """Return the modes of the latent coordinates (m, d, r) of `PodFields` at points by number."""
    return fields.U[points][:, :, :fields.r].astype(float, copy=False)


def principal_axes(X):
    """Return the principal axes (d, k) of places X (n, d) over the standard deviation along each;
    axes along which X is flat are left out.
    """
    centered = X - X.mean(axis=0)
    variance, axes = np.linalg.eigh(centered.T @ centered / len(X))
    extended = variance > RANK * variance[-1]
    return axes[:, extended] / np.sqrt(variance[extended])


def spread(X_samples, axes):
    """Return the standard deviation of the places X_samples (m, d) over that of the body, along the
    one of its `principal_axes` where it is least.
    """
    return float((X_samples @ axes).std(axis=0).min())


def coverage(G, G_samples):
    """Return the least, over all changes y of the latent coordinates that move the body, of the rms
    motion G_samples y of samples over that of the body's points G y; G (n, d, r), G_samples (m, d,
    r). 0 where no motion shows, or nothing is finite.
    """
    return share_of_motion(G_samples, modes_of_motion(G))


def modes_of_motion(G):
    """Return the changes of the latent coordinates (r, k) that move the body's points by 1 rms
    each, in orthogonal ways, of G (n, d, r); none where G is not finite.
    """
    A = G.reshape(-1, G.shape[2]) / np.sqrt(len(G))
    if not np.isfinite(A).all():
        return np.zeros((A.shape[1], 0))
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    moving = s > RANK * s[0]
    return Vt[moving].T / s[moving]


def share_of_motion(G_samples, moving):
    """Return the least rms motion of samples, G_samples (m, d, r), by the changes `moving` (r, k)
    of `modes_of_motion`.
    """
    B = G_samples.reshape(-1, G_samples.shape[2]) @ moving / np.sqrt(len(G_samples))
    if len(B) < B.shape[1] or not B.shape[1] or not np.isfinite(B).all():
        return 0.0
    return float(np.linalg.svd(B, compute_uv=False)[-1])
