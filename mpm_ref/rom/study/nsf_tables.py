"""The tables of a study file with model = "nsf", as far as they differ from LDM's;
docs/reference/studies.md explains their keys.
"""

from typing import Annotated, ClassVar

from msgspec import Meta

from ...shapes.quantities import Count, Natural, NotNegative, Positive, Seed
from ..fields.pod_fields import Sizes
from ..projection import INVERSIONS
from .nsf_run import Plan
from .tables import MODES, NETWORK, Kinds, Runs, Table, one_of

NUMBERS = ("modes", "tau", "C", "weight", "smoothing")     # of `Sizes`
KEYS = {                            # of fields of each kind, beside `kind` and `r`
    MODES: (*NUMBERS, "stress_sees_parameters"),
    NETWORK: ("stress_sees_parameters", "beta", "octaves", "latent", "schedule", "epochs",
              "field_epochs", "batch", "points", "seed"),
}
LATENTS, SCHEDULES = ("encoder-nsf", "free", MODES), ("steps", "cosine")    # see `rom.train`
SIZES = Sizes._field_defaults
Width = Annotated[int, Meta(ge=1, le=1000)]
Factors = Annotated[tuple[Width, ...], Meta(min_length=3, max_length=3)]
Octaves = Annotated[int, Meta(ge=0, le=16)]
Step = Annotated[float, Meta(ge=0.01)]


class Fields(Kinds):
    """The fields: sums of modes (see `rom.fields.pod_fields`), or networks and how they are
    trained (see `rom.train.settings.stage_plan`).
    """

    keys: ClassVar[dict] = KEYS
    modes: Count = SIZES["modes"]               # of the displacement, r of them free
    tau: Count = SIZES["tau"]                   # of the stress
    C: Natural = SIZES["C"]                     # of the affine field; 0: there is none
    stress_sees_parameters: bool = True         # whether it is a function of them (NSF-mu-dep)
    weight: Positive = SIZES["weight"]          # of these beside latent coordinates
    smoothing: NotNegative = SIZES["smoothing"]
    beta: Factors = (16, 16, 16)                # widths of hidden layers over numbers of values
    octaves: Octaves = 0                        # of Fourier features (see `rom.fields.perceptron`)
    latent: str = LATENTS[0]
    schedule: str = SCHEDULES[0]                # of learning rates
    epochs: Count = 1500                        # of the position
    field_epochs: Count = 3000                  # of the stress, and of the affine field
    batch: Count = 32                           # snapshots at a time
    points: Natural = 0                         # of each, anew each time; 0: all
    seed: Seed = 0

    def __post_init__(self):
        super().__post_init__()
        one_of("latent", self.latent, LATENTS)
        one_of("schedule", self.schedule, SCHEDULES)
        if self.kind == MODES and self.modes < self.r:
            raise ValueError(f"modes = {self.modes}: expected at least r = {self.r} modes of the "
                             "displacement, whose first coefficients are the latent coordinates")

    @property
    def sizes(self):
        """As `spanned` takes them."""
        return Sizes(**{name: getattr(self, name) for name in ("r", *NUMBERS)})

    @property
    def total(self):
        """Epochs of all stages."""
        return self.epochs + 2 * self.field_epochs


class Run(Table):
    """How reduced runs are made (see `inferring.Plan`)."""

    points: Count | None = None                 # samples, drawn once; none: all points
    seed: Seed = 0                              # of that draw
    weighed: bool = False                       # whether they have weights, and are at most so many
    cells: Count | None = None                  # of all samples, which then have weights, at most
    faster: Step = Plan(()).faster              # length of a step over that of the scene
    inversion: str = Plan(()).inversion

    def __post_init__(self):
        one_of("inversion", self.inversion, INVERSIONS)
        if self.cells is not None and (self.weighed or self.points is not None):
            raise ValueError(f"cells = {self.cells}: samples are points of so many cells and have "
                             "weights; expected neither `points` nor `weighed` beside it")
        if self.weighed and self.points is None:
            raise ValueError("weighed = true: expected `points` beside it, how many samples there "
                             "may be")


class Tables(Runs, kw_only=True):
    """A study file with model = "nsf"."""

    map: Fields
    run: Run = Run()
