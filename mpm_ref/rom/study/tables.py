"""The tables of a study file: one record each; docs/reference/studies.md explains their keys."""

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta, Struct, field, to_builtins

from ...shapes.quantities import Count, Natural, PerCell, Positive, Seed
from ..fields.architecture import HIDDEN
from ..latent import VELOCITIES
from .run import PRECISIONS, PROJECTIONS, QUADRATURES, Way

LDM, NSF = "ldm", "nsf"             # reduced models; tables of the second are in `nsf.tables`
MODES, CURVED, NETWORK = "modes", "curved", "network"
KEYS = {                            # of a map of each kind, beside `kind` and `r`
    MODES: (),
    CURVED: ("modes", "degree"),
    NETWORK: ("hidden", "latent", "weights", "epochs", "batch", "points", "dense", "every",
              "seed"),
}
GRID, LATIN = "grid", "latin"
LATENTS = ("encoder", "free", MODES)                # see `rom.train.decoder.Training`
RESAMPLED, SAMPLES = "resampled", ("redrawn", "kept", "pivoted")       # see `march.Way`
WEIGHTS = ("code", "printed", "scaled")             # of the loss, see `maps.larger`
Word = Annotated[str, Meta(pattern=r"^\w[\w.-]*\Z", max_length=100)]
Bend = Annotated[int, Meta(ge=2)]


def one_of(name, value, known):
    """Raise ValueError unless a value is known."""
    if value not in known:
        raise ValueError(f"{name} = {value!r}: expected one of {', '.join(map(repr, known))}")


def require_nonlinear(kind, projection):
    """Raise ValueError for linear projection on a map that is curved."""
    if kind == CURVED and projection != "nonlinear":
        raise ValueError(f"run.projection = {projection!r}: expected 'nonlinear' for a curved map, "
                         "since linear projection leaves the curve in every step")


class Table(Struct, frozen=True, kw_only=True):
    """A table of a study file."""


class Parameter(Table, rename={"start": "from", "stop": "to"}):
    """What differs between runs: a name, its place in the scene, and its values."""

    name: Word
    key: str                                    # path into the scene (see `vary`)
    values: Annotated[tuple[float, ...], Meta(min_length=1)] | None = None      # all of them, or
    start: float | None = None                  # from here
    stop: float | None = None                   # ... to here
    count: Count | None = None                  # ... so many, evenly spaced
    scale: float = 1.0                          # factor from the value to what the scene gets

    def __post_init__(self):
        ends = self.start is not None, self.stop is not None
        if (self.values is not None) == any((*ends, self.count is not None)):
            raise ValueError("a parameter needs `values`, or `from`, `to` and `count`")
        if self.values is None and not (all(ends) and self.start < self.stop):
            raise ValueError("a parameter without `values` needs `from` and a larger `to`")
        if self.values is not None and len(set(self.values)) < len(self.values):
            raise ValueError(f"values = {list(self.values)}: expected numbers that differ")

    def grid(self):
        """Its values on a grid. Raises ValueError where it does not say how many."""
        if self.values is not None:
            return np.array(self.values)
        if self.count is None:
            raise ValueError("`count` is missing: how many values on the grid?")
        return np.linspace(self.start, self.stop, self.count)


class Kinds(Table):
    """What is learned, of one of several kinds, each with keys of its own."""

    keys: ClassVar[dict]                        # {kind: names of its keys, beside `kind` and `r`}
    kind: str
    r: Count                                    # latent coordinates

    def __post_init__(self):
        one_of("kind", self.kind, self.keys)

    @property
    def settings(self):
        """{key: value} of the keys of its kind, plain values."""
        known = ("kind", "r", *self.keys[self.kind])
        return {key: value for key, value in to_builtins(self).items() if key in known}


class Map(Kinds, kw_only=True):
    """The map: POD modes, straight or bent (see `rom.fields.polynomial_manifold`), or a
    network and how it is trained (see `rom.train.decoder.Training`).
    """

    keys = KEYS
    modes: Count | None = None                  # of a curved map: those kept, r of them free
    degree: Bend = 2                            # ... of the polynomials that the others are
    hidden: tuple[Count, ...] = HIDDEN
    latent: str = LATENTS[0]
    weights: str = WEIGHTS[0]
    epochs: Count = 850
    batch: Count = 8                            # snapshots at a time
    points: Natural = 0                         # of each, anew each time; 0: all
    dense: Natural = 0                          # time levels that every epoch shows; of later
    every: Count = 1                            # ... ones, one in `every`
    seed: Seed = 0

    @property
    def total(self):
        """Epochs of a training."""
        return self.epochs

    def __post_init__(self):
        super().__post_init__()
        if self.kind == CURVED and (self.modes or 0) <= self.r:
            raise ValueError(f"modes = {self.modes or 'none'}: expected more than r = {self.r} of "
                             "a curved map, whose others follow from the first r")
        one_of("latent", self.latent, LATENTS)
        one_of("weights", self.weights, WEIGHTS)


class Run(Table):
    """How reduced runs are made (see `march.Way`)."""

    quadrature: str = Way().quadrature
    projection: str = Way().projection
    points: Count | None = None                 # samples; none: all points
    samples: str = Way().samples
    per_cell: PerCell = Way().per_cell          # quadrature points per axis, not material ones
    close: Positive = Way().close               # how near Eulerian points are traced back [dx]
    precision: str = Way().precision            # of a network
    velocity: str = Way().velocity
    seed: Seed = 0                              # of the samples

    def __post_init__(self):
        one_of("quadrature", self.quadrature, (*QUADRATURES, RESAMPLED))
        one_of("samples", self.samples, SAMPLES)
        one_of("projection", self.projection, PROJECTIONS)
        one_of("velocity", self.velocity, VELOCITIES)
        one_of("precision", self.precision, PRECISIONS)

    @property
    def way(self):
        """As `march` takes it."""
        return Way(**{name: getattr(self, name) for name in Way._fields})


class Runs(Table):
    """A study file, but for what is learned and how reduced runs are made."""

    scene: str                                  # a file, from the folder of this one; or shipped
    parameter: Annotated[tuple[Parameter, ...], Meta(min_length=1)]
    model: str = LDM
    title: str = ""
    set: dict = field(default_factory=dict)     # {path: value} of the scene, in all runs
    sampling: str = GRID                        # of the parameters
    count: Count | None = None                  # runs of a Latin hypercube
    test: Natural = 0                           # runs held out, drawn at random
    seed: Seed = 0                              # of the draws

    def __post_init__(self):
        one_of("sampling", self.sampling, (GRID, LATIN))
        if (self.count is not None) != (self.sampling == LATIN):
            hint = (", and only there" if self.count is not None else ": add `count = N` beside "
                    "`sampling`, take it from [[parameter]]")
            raise ValueError(f'count: expected with sampling = "{LATIN}"{hint}')
        for name in ("name", "key"):
            texts = [getattr(one, name) for one in self.parameter]
            if len(set(texts)) < len(texts):
                raise ValueError(f"parameter: two have the same {name}")


class Tables(Runs, kw_only=True):
    """A study file of LDM's reduced model."""

    map: Map
    run: Run = Run()

    def __post_init__(self):
        require_nonlinear(self.map.kind, self.run.projection)
        super().__post_init__()
