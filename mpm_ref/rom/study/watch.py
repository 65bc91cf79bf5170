"""Whether a reduced run is still where its map has learned something, and when no body is left.

Nothing in a reduced step fails where the map knows nothing: it goes on, smooth and wrong. What
tells it, from a few points and what the step reports, in each state:

    beyond      how far the latent coordinates are from the trained ones (`rom.extrapolation`)
    off         how far the step took the samples off the map's states, in cells: forces that the
                map cannot follow, and time steps that are too long. At the start, how far the body
                is from where it should be: a map of another body
    seen        how much of each motion of the body the samples saw in the last steps: too few, or
                all in one place
    blind       latent coordinates that moved no sample, or not otherwise than others
    lost        quadrature points that could not be traced back into the body
    inverted    points with det F <= 0

The bounds lie between what was seen in trial runs within the trained range, of gravity and torsion,
and what in runs that had gone wrong. `python -m validation run extremes.ldm` records both anew, and
how often the bounds err, also on maps that they were not chosen with.
"""

from typing import NamedTuple

import numpy as np

from ..extrapolation import BEYOND, Extent, evenly, trained_extent
from ..projection import RANK
from .run import continued, picked, start

LOOKED = 64         # points of the body that are looked at, and samples
OFF = 0.033         # [dx]; hardly separates runs in range from those with twice the time step
SEEN = 0.3          # low enough for ten samples and seven coordinates
MEMORY = 0.8        # share of what was seen before in what counts as seen: a poor draw is forgiven
LOST = 0.01         # of the quadrature points; in range none
NONSENSE = 0.1      # of the points looked at; more that are inverted are no body,
NOWHERE = 100.0     # nor are latent coordinates so many times as far from the trained mean as any
                    # trained ones

WORDS = {
    "beyond": "the latent coordinates are {beyond:.3g} times as far from the training runs as "
              "these are from each other",
    "off": "the samples went {off:.2g} cells off the map's states",
    "seen": "of some motion of the body the samples saw only {seen:.0%}",
    "blind": "{blind} of the latent coordinates could not be told from the samples",
    "lost": "{lost:.1%} of the quadrature points could not be traced back",
    "inverted": "{inverted:.1%} of the points looked at are inverted, det F down to {J:.3g}",
}


class Nonsense(RuntimeError):
    """A reduced run in which no body is left."""


class Sight(NamedTuple):
    """A state of a reduced run, looked at."""

    beyond: float       # distance of xhat from the trained ones, over their largest gap
    off: float          # rms distance from the map's states that the step was projected over [dx]
    seen: float         # rms motion of the samples over that of the body, in the direction of xhat
                        # where it is least; a mean over the last steps
    blind: int          # r less the rank of dg/dxhat at the samples
    lost: float         # share of quadrature points that were not traced back
    J: float            # smallest det F of the points looked at
    inverted: float     # share of them whose det F is not above 0
    far: float          # distance of xhat from the mean of the trained ones, over their largest

    @property
    def nonsense(self):
        """Why there is no body, in words; "" where there is one."""
        if self.inverted > NONSENSE:
            return f"{self.inverted:.0%} of the points looked at have no det F > 0"
        if self.far > NOWHERE:
            return (f"the latent coordinates are {self.far:.3g} times as far from the trained mean "
                    "as any trained ones")
        return ""

    @property
    def why(self):
        """What is out of bounds: names of fields, none where all is well."""
        out = {"beyond": not self.beyond <= BEYOND, "off": not self.off <= OFF,
               "seen": not self.seen >= SEEN, "blind": self.blind > 0,
               "lost": not self.lost <= LOST, "inverted": self.inverted > 0.0}
        return tuple(name for name, is_out in out.items() if is_out)

    @property
    def said(self):
        """The same in words."""
        return "; ".join(WORDS[name].format(**self._asdict()) for name in self.why)


class Watch(NamedTuple):
    """What a state of a reduced run is looked at with."""

    map: object
    X: np.ndarray       # (n, d) points looked at, at rest [m]
    extent: Extent      # of the training latents
    dx: float           # of the grid [m]
    dt: float           # [s]

    def look(self, latent, report=None, samples=None, last=None):
        """`Sight` of a `Latent`, reached by a step with a `Report` and samples (m, d) at rest [m]
        from a state whose `Sight` was `last`; of the start, without them. It costs derivatives at
        LOOKED points, and as many samples.
        """
        with np.errstate(all="ignore"):
            x, F, G = self.map.derivatives(self.X, latent.xhat)
            J = np.linalg.det(F)
            misfit = float(np.sqrt(np.mean(np.sum((x - self.X) ** 2, axis=1))))
        found = {"beyond": float(self.extent.beyond(latent.xhat)), "off": misfit / self.dx,
                 "seen": 1.0, "blind": 0, "lost": 0.0}
        if report is not None:
            lost = report.quadrature.get("lost", 0)
            G_samples = self.map.derivatives(evenly(samples, LOOKED), latent.xhat)[2]
            found |= {"off": report.residual * self.dt / self.dx,
                      "seen": MEMORY * last.seen + (1.0 - MEMORY) * seen(G, G_samples),
                      "blind": self.map.r - report.rank, "lost": lost / (lost + report.points)}
        return Sight(**found, J=float(J.min()), inverted=float(np.mean(~(J > 0.0))),
                     far=float(self.extent.outlying(latent.xhat)))

    def least(self, latent):
        """The point X (d,) [m] with the smallest det F, or with none, and that det F."""
        with np.errstate(all="ignore"):
            J = np.linalg.det(self.map.derivatives(self.X, latent.xhat)[1])
        p = int(np.argmin(np.where(np.isfinite(J), J, -np.inf)))
        return self.X[p], float(J[p])


def watch(case, map, xhat):
    """`Watch` of reduced runs of a `Case` on a map with training latents xhat (s, k + 1, r). Raises
    ValueError where these do not differ.
    """
    X = evenly(case.X, LOOKED)
    clock = case.problem.clock
    return Watch(map, X, trained_extent(map, case.X, xhat), case.problem.dx, clock.dt)


def watched(watch, case, way, rest, seed=0, pick=None):
    """Yield (`Latent`, `Report` or None, `Sight`) of a reduced run, as `march` makes it. Raises
    `Nonsense` where it has left no body, and what `march` raises.
    """
    begin = start(case, watch.map, rest)
    pick = pick or picked(case, watch.map, way, begin.xhat, seed)
    yield from watched_on([(begin, None)], watch, case, way, pick)


def watched_on(known, watch, case, way, pick):
    """Yield the same of a run whose first states are known, as `march.continued` makes it."""
    taken, sight, first = [], None, None

    def kept(t):
        taken[:] = [pick(t)]
        return taken[0]

    for k, (latent, report) in enumerate(continued(known, case, watch.map, way, kept)):
        sight = watch.look(latent, report, case.X[taken[0]] if taken else None, sight)
        first = first or ((k, sight) if sight.why else None)
        if sight.nonsense:
            raise Nonsense(sentence(watch, latent, k, sight, first))
        yield latent, report, sight


def sentence(watch, latent, k, sight, first):
    """Where, when and why no body is left after step k; first: (step, `Sight`) out of bounds."""
    X, J = watch.least(latent)
    place = ", ".join(f"{a:.3g}" for a in X)
    return (f"step {k}, t = {k * watch.dt:.6g} s: no body is left, {sight.nonsense}; det F is "
            f"least at X = {place} m, {J:.3g}; out of bounds since step {first[0]}: "
            f"{first[1].said}. Keep to the parameters that the map was trained with, take more "
            "samples or a smaller dt")


def seen(G, G_samples):
    """The least, over all changes y of the latent coordinates that move the body, of the rms motion
    G_samples y of samples over that of the body's points G y; G (n, d, r), G_samples (m, d, r).
    0 where nothing is seen, or nothing finite.
    """
    A, B = (a.reshape(-1, a.shape[2]) / np.sqrt(len(a)) for a in (G, G_samples))
    if not (np.isfinite(A).all() and np.isfinite(B).all()):
        return 0.0
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    moving = s > RANK * s[0]
    B = B @ (Vt[moving].T / s[moving])
    if len(B) < B.shape[1] or not moving.any():
        return 0.0
    return float(np.linalg.svd(B, compute_uv=False)[-1])
