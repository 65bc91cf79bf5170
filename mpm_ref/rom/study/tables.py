"""The tables of a study file: one record each; docs/reference/studies.md explains their keys."""

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta, Struct, field, to_builtins

from ...shapes.quantities import Count, Natural, NotNegative, PerCell, Positive, Seed
from ..evolution import GRADIENTS
from ..fields.architecture import HIDDEN
from ..fields.pod_fields import Sizes
from ..latent import VELOCITIES
from ..projection import INVERSIONS, require_tolerance
from ..quadrature.eulerian import BOUNDARY_CELLS
from .run import PRECISIONS, PROJECTIONS, QUADRATURES, RunOptions

LDM, NSF = "ldm", "nsf"             # methods
MODES, CURVED, NETWORK = "modes", "curved", "network"
KEYS = {                            # of LDM's map of each kind, beside `kind` and `r`
    MODES: (),
    CURVED: ("modes", "degree"),
    NETWORK: ("hidden", "latent", "weights", "epochs", "batch", "points", "dense", "every",
              "seed"),
}
GRID, LATIN = "grid", "latin"
LATENTS = ("encoder", "free", MODES)                # see `rom.train.decoder.DecoderTraining`
RESAMPLED, SAMPLES = "resampled", ("redrawn", "kept", "pivoted")       # see `run.RunOptions`
WEIGHTS = ("code", "printed", "scaled")             # of the loss, see `reduce.size_ratios`
SIZES = Sizes._field_defaults
NUMBERS = ("modes", "tau", "C", "weight", "smoothing")     # of `Sizes`
NSF_KEYS = {                        # of NSF's fields of each kind, beside `kind` and `r`
    MODES: (*NUMBERS, "stress_sees_parameters"),
    NETWORK: ("stress_sees_parameters", "beta", "octaves", "latent", "schedule", "epochs",
              "field_epochs", "batch", "points", "seed"),
}
NSF_LATENTS, SCHEDULES = ("encoder-nsf", "free", MODES), ("steps", "cosine")    # see `rom.train`
Word = Annotated[str, Meta(pattern=r"^\w[\w.-]*\Z", max_length=100)]
Degree = Annotated[int, Meta(ge=2)]
Width = Annotated[int, Meta(ge=1, le=1000)]
Factors = Annotated[tuple[Width, ...], Meta(min_length=3, max_length=3)]
Octaves = Annotated[int, Meta(ge=0, le=16)]
StepFactor = Annotated[float, Meta(ge=0.01)]


def one_of(name, value, allowed):
    """Raise ValueError unless a value is one of those allowed."""
    if value not in allowed:
        raise ValueError(f"{name} = {value!r}: expected one of {', '.join(map(repr, allowed))}")


def require_nonlinear(kind, projection):
    """Raise ValueError for linear projection on a map that is curved."""
    if kind == CURVED and projection != "nonlinear":
        raise ValueError(f"run.projection = {projection!r}: expected 'nonlinear' for a curved map, "
                         "since linear projection leaves the curve in every step")


def require_precision(kind, precision):
    """Raise ValueError for NSF's fields of a kind that has no single precision."""
    if precision == "single" and kind != MODES:
        raise ValueError(f"run.precision = 'single': expected 'double' for fields of kind "
                         f"{kind!r}; only modes are stored in single precision")


NAMES = {"reduced_model": "map", "overrides": "set"}       # of keys in a file


class StudyTable(Struct, frozen=True, kw_only=True):
    """A table of a study file."""


class Parameter(StudyTable, rename={"start": "from", "stop": "to"}):
    """A parameter that differs between runs: its name, its key in the scene, and its values."""

    name: Word
    key: str                                    # path into the scene (see `scene.overrides`)
    values: Annotated[tuple[float, ...], Meta(min_length=1)] | None = None      # all of them, or
    start: float | None = None                  # from here
    stop: float | None = None                   # ... to here
    count: Count | None = None                  # ... this many, evenly spaced
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
        """Return the parameter's values on a grid. Raises ValueError without their number."""
        if self.values is not None:
            return np.array(self.values)
        if self.count is None:
            raise ValueError("`count` is missing: how many values on the grid?")
        return np.linspace(self.start, self.stop, self.count)


class ReducedModelTable(StudyTable):
    """A reduced model of one of several kinds, each with keys of its own."""

    keys: ClassVar[dict]                        # {kind: names of its keys, beside `kind` and `r`}
    kind: str
    r: Count                                    # latent coordinates

    def __post_init__(self):
        one_of("kind", self.kind, self.keys)

    @property
    def settings(self):
        """The {key: value} of the keys of its kind, plain values."""
        known = ("kind", "r", *self.keys[self.kind])
        return {key: value for key, value in to_builtins(self).items() if key in known}


class MapTable(ReducedModelTable, kw_only=True):
    """LDM's map: POD modes, linear or curved (see `rom.fields.polynomial_manifold`), or a
    network with the settings of its training (see `rom.train.decoder.DecoderTraining`).
    """

    keys = KEYS
    modes: Count | None = None                  # of a curved map, r of them free
    degree: Degree = 2                            # ... of the polynomials that the others are
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
        """Number of epochs of a training."""
        return self.epochs

    def __post_init__(self):
        super().__post_init__()
        if self.kind == CURVED and (self.modes or 0) <= self.r:
            raise ValueError(f"modes = {self.modes or 'none'}: expected more than r = {self.r} of "
                             "a curved map, whose others follow from the first r")
        one_of("latent", self.latent, LATENTS)
        one_of("weights", self.weights, WEIGHTS)


class MapRunTable(StudyTable):
    """Options of LDM's reduced runs (see `run.RunOptions`)."""

    quadrature: str = RunOptions().quadrature
    projection: str = RunOptions().projection
    points: Count | None = None                 # samples; none: all points
    samples: str = RunOptions().samples
    per_cell: PerCell = RunOptions().per_cell  # quadrature points per axis, not material ones
    preimage_tolerance: Positive = RunOptions().preimage_tolerance  # distance of Eulerian points
                                                # from their places [dx]
    precision: str = RunOptions().precision            # of a network
    driven_weight: Positive = RunOptions().driven_weight    # largest weight, of a
                                                # sample whose velocity is prescribed
    boundary_cells: str = RunOptions().boundary_cells  # of Eulerian points
    deformation_gradient: str = RunOptions().deformation_gradient   # of material points
    velocity: str = RunOptions().velocity
    seed: Seed = 0                              # of the samples

    def __post_init__(self):
        one_of("quadrature", self.quadrature, (*QUADRATURES, RESAMPLED))
        one_of("samples", self.samples, SAMPLES)
        one_of("projection", self.projection, PROJECTIONS)
        one_of("velocity", self.velocity, VELOCITIES)
        one_of("precision", self.precision, PRECISIONS)
        one_of("boundary_cells", self.boundary_cells, BOUNDARY_CELLS)
        one_of("deformation_gradient", self.deformation_gradient, GRADIENTS)

    @property
    def options(self):
        """The `RunOptions` of these values."""
        return RunOptions(**{name: getattr(self, name) for name in RunOptions._fields})


class CommonTables(StudyTable, rename=NAMES):
    """Keys of a study file of any method."""

    scene: str                                  # a file, from the folder of this one; or bundled
    parameter: Annotated[tuple[Parameter, ...], Meta(min_length=1)]
    model: str = LDM
    title: str = ""
    overrides: dict = field(default_factory=dict)   # {path: value} of the scene, in all runs
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


class MapTables(CommonTables, kw_only=True, rename=NAMES):
    """The tables of a study file of LDM."""

    reduced_model: MapTable
    run: MapRunTable = MapRunTable()

    def __post_init__(self):
        require_nonlinear(self.reduced_model.kind, self.run.projection)
        super().__post_init__()


class FieldsTable(ReducedModelTable):
    """NSF's fields: sums of modes (see `rom.fields.pod_fields`), or networks with the settings of
    their training (see `rom.train.settings.stage_plan`).
    """

    keys: ClassVar[dict] = NSF_KEYS
    modes: Count = SIZES["modes"]               # of the displacement, r of them free
    tau: Count = SIZES["tau"]                   # of the stress
    C: Natural = SIZES["C"]                     # of the affine field; 0: there is none
    stress_sees_parameters: bool = True         # whether it is a function of them (NSF-mu-dep)
    weight: Positive = SIZES["weight"]          # of these beside latent coordinates
    smoothing: NotNegative = SIZES["smoothing"]
    beta: Factors = (16, 16, 16)                # widths of hidden layers over numbers of values
    octaves: Octaves = 0                        # of Fourier features (see `rom.fields.perceptron`)
    latent: str = NSF_LATENTS[0]
    schedule: str = SCHEDULES[0]                # of learning rates
    epochs: Count = 1500                        # of the position
    field_epochs: Count = 3000                  # of the stress, and of the affine field
    batch: Count = 32                           # snapshots at a time
    points: Natural = 0                         # of each, anew each time; 0: all
    seed: Seed = 0

    def __post_init__(self):
        super().__post_init__()
        one_of("latent", self.latent, NSF_LATENTS)
        one_of("schedule", self.schedule, SCHEDULES)
        if self.kind == MODES and self.modes < self.r:
            raise ValueError(f"modes = {self.modes}: expected at least r = {self.r} modes of the "
                             "displacement, whose first coefficients are the latent coordinates")

    @property
    def sizes(self):
        """The `Sizes`, as `fit_pod_fields` takes them."""
        return Sizes(**{name: getattr(self, name) for name in ("r", *NUMBERS)})

    @property
    def total(self):
        """Number of epochs of all stages."""
        return self.epochs + 2 * self.field_epochs


class FieldsRunTable(StudyTable):
    """Options of NSF's reduced runs (see `run.nsf_run`)."""

    points: Count | None = None                 # samples, drawn once; none: all points
    seed: Seed = 0                              # of that draw
    weighted: bool = False  # whether they have weights, and are at most `points`
    cells: Count | None = None                  # of all samples, which then have weights, at most
    dt_factor: StepFactor = 1.0                 # length of a step over that of the scene
    inversion: str = INVERSIONS[0]
    inversion_tolerance: Positive | None = None     # see `projection.PositionInversion`
    precision: str = PRECISIONS[0]              # of modes

    def __post_init__(self):
        one_of("inversion", self.inversion, INVERSIONS)
        one_of("precision", self.precision, PRECISIONS)
        if self.inversion_tolerance is not None:
            require_tolerance(self.inversion_tolerance, self.inversion)
        if self.cells is not None and (self.weighted or self.points is not None):
            raise ValueError(f"cells = {self.cells}: samples are points of this many cells and "
                             "have weights; expected neither `points` nor `weighted` beside it")
        if self.weighted and self.points is None:
            raise ValueError("weighted = true: expected `points` beside it, the largest number of "
                             "samples")


class FieldsTables(CommonTables, kw_only=True, rename=NAMES):
    """The tables of a study file with model = "nsf"."""

    reduced_model: FieldsTable
    run: FieldsRunTable = FieldsRunTable()

    def __post_init__(self):
        require_precision(self.reduced_model.kind, self.run.precision)
        super().__post_init__()


TABLES = {LDM: (MapTables, MapTable, MapRunTable),         # of each method: all, [map], [run]
          NSF: (FieldsTables, FieldsTable, FieldsRunTable)}
