"""Records of the tables of a scene file, with the names, units and bounds of their keys.

docs/reference/scenes.md explains each key. A record checks conditions within its table; `validate`
checks those across tables, and `builder` builds objects from records.
"""

from typing import Annotated, Literal

from msgspec import Meta

from ..explicit import Scheme as ExplicitScheme
from ..materials import LAWS, make_flow, make_law
from ..materials.learned import learned_flow, learned_law, weights
from ..materials.learned.table import TABLES
from ..materials.learned.weights import dim_of
from ..sampling import Regular, Samplings
from ..shapes import Analytic, Shape
from ..shapes.quantities import (
    Angle,
    Coordinate,
    Count,
    Friction,
    Kind,
    Length,
    Natural,
    NotNegative,
    Positive,
    Record,
    Seed,
    Sha256,
    Share,
    Vector,
)
from .quantity_records import Quantities
from .stream_records import Sink, Stream, check_source

Name = Annotated[str, Meta(min_length=1, max_length=100, pattern=r"^[A-Za-z0-9_. -]+\Z")]
Time = Annotated[float, Meta(ge=-1e12, le=1e12)]                        # [s]
Node = Annotated[int, Meta(ge=-1_000_000_000, le=1_000_000_000)]
WallNodes = Annotated[tuple[Node | Literal["open"], ...], Meta(min_length=2, max_length=3)]
Table = Annotated[tuple[Coordinate | Vector, ...], Meta(min_length=2)]
Number = Annotated[float, Meta(ge=-1e30, le=1e30)]
NEURAL = "neural"       # the law whose parameters are a file


class Flow(Record, rename={"name": "type"}):
    """A return map by its name in `materials.FLOWS`, and its parameters.

    The key in a scene file is `type`, as in all other tables that name a kind.
    """

    name: str
    friction_angle: Number | None = None        # [degrees]
    s_min: Number | None = None
    s_max: Number | None = None
    sigma_y: Number | None = None               # [Pa] in uniaxial tension, or
    tau_y: Number | None = None                 # [Pa] as Frobenius norm of the deviator
    xi: Number | None = None
    theta: Number | None = None                 # [Pa]
    eta: Number | None = None                   # [Pa s]


class Material(Record):
    """A material: an elastic law by its name in `materials.LAWS`, its parameters and a return map.

    The law "neural" is a file that holds a learned law and its return map.
    """

    law: str
    E: Number | None = None                     # [Pa]
    nu: Number | None = None
    lam: Number | None = None                   # [Pa]
    weights: str | None = None                  # file of trained laws (see learned.weights)
    sha256: Sha256 | None = None                # of what that file must hold
    guard: bool = True                          # whether strains are cut (see learned.guard)
    precision: Literal["double", "single"] = "double"   # of a network's layers (learned.layers)
    flow: Flow = Flow(name="none")

    def __post_init__(self):
        if self.law != NEURAL and not self.guard:
            raise ValueError(f"guard = false: expected with the law {NEURAL!r} alone, whose "
                             "strains it cuts to those of training")
        if self.law != NEURAL and self.precision != "double":
            raise ValueError(f"precision = {self.precision!r}: expected with the law {NEURAL!r} "
                             "alone, of whose layers it is; `scheme.precision` is that of a step")
        if self.law == NEURAL:
            self.trained()
        elif self.law in LAWS:
            self.elastic()
        else:
            raise ValueError(f"law {self.law!r}: expected one of {', '.join((*LAWS, NEURAL))}")

    @property
    def is_neural(self):
        """Return whether the law is learned."""
        return self.law == NEURAL

    def build(self, dim):
        """Return the law, the return map in `dim` dimensions, and the `about` of learned laws.

        `about` says how the laws were trained; it is None for laws by name. Raises ValueError for a
        name, a parameter or a file that does not fit.
        """
        if self.is_neural:
            laws = self.trained(dim)
            return (learned_law(laws.elastic, self.precision),
                    learned_flow(laws.plastic, self.precision), laws.about)
        law = self.elastic()
        return law, make_flow(self.flow.name, law, dim, **_given(self.flow, "name")), None

    def elastic(self):
        """Return the elastic law by its name. Raises ValueError as `build`."""
        return make_law(self.law, **_given(self, "law", "guard", "precision", "flow"))

    def trained(self, dim=None):
        """Return the `LearnedLaws` of the file.

        Raises ValueError for a file without laws or of other dimensions, and for superfluous keys.
        """
        superfluous = [*_given(self, "law", "weights", "sha256", "guard", "precision", "flow")]
        superfluous += ["flow"] if self.flow != Flow(name="none") else []
        if superfluous:
            raise ValueError(f"law {NEURAL!r}: unknown parameter {', '.join(superfluous)}; all "
                             "that it takes is `weights`, which hold the return map too, "
                             "`guard` and `precision`")
        if self.weights is None:
            raise ValueError(f"law {NEURAL!r}: missing parameter weights, a file of trained laws")
        laws = weights.load(self.weights)
        self._require_kinds(laws)
        if dim not in (None, dim_of(laws)):
            raise ValueError(f"weights = {self.weights!r}: its laws are for dim = {dim_of(laws)}, "
                             f"expected dim = {dim}")
        return laws

    def _require_kinds(self, laws):
        for part in weights.PARTS:
            kind = type(getattr(laws, part).kind)
            if not TABLES[part][kind].in_scenes:
                raise ValueError(
                    f"weights = {self.weights!r}: its {part} law is of kind {kind.__name__}; "
                    'expected networks as of the methods "ours" or "admissible"; `mpm-ref law '
                    "evaluate` runs any, and identified constants can be written here")


def _given(record, *but):
    """Return the keys of a record that have a value, except those of `but`."""
    values = {name: getattr(record, name) for name in record.__struct_fields__ if name not in but}
    return {name: value for name, value in values.items() if value is not None}


class Velocity(Record):
    """The initial velocity linear + angular x (x - center); default center: that of mass."""

    linear: Vector | None = None                # [m/s]
    angular: Coordinate | Vector = 0.0          # [rad/s], a number in 2D, a vector in 3D
    center: Vector | None = None                # [m]

    @property
    def moves(self):
        """Return whether the velocity is not zero."""
        return self.linear is not None or self.angular != 0.0


class Arrays(Record):
    """Particles from the arrays of an NPZ or HDF5 file.

    Without `file`, arrays with this `sha256` are passed in Python (`problem_from_arrays`).
    """

    file: str | None = None
    sha256: Sha256 | None = None                # of what the file must hold
    group: str = "/"                            # of an HDF5 file
    select: Annotated[int, Meta(ge=0)] | None = None    # particles whose `body` has this value
    ignore: tuple[str, ...] = ()                # other arrays in the file
    offset: Vector | None = None                # added to the positions [m]

    def __post_init__(self):
        if self.file is None and self.sha256 is None:
            raise ValueError("the key `file` is missing")


class Body(Record):
    """Particles of one material: a shape and how to fill it, or arrays from a file; with a source,
    a stream of blocks of that shape.
    """

    name: Name
    material: Material
    shape: Shape | None = None
    sampling: Samplings = Regular()
    particles: Arrays | None = None
    density: Positive | None = None             # at rest [kg/m^3]
    velocity: Velocity = Velocity()
    source: Stream | None = None

    def __post_init__(self):
        if (self.shape is None) == (self.particles is None):
            raise ValueError("a body needs `shape` or `particles`, one of the two")
        if self.shape is not None and self.density is None:
            raise ValueError("a body with a shape needs `density`")
        if self.particles is not None and self.sampling != Regular():
            raise ValueError("`sampling` is for a body with a shape, not for `particles`")
        if self.source is not None:
            check_source(self)


class Steady(Kind, tag="steady"):
    """A constant rate [m/s or rad/s] from `start` to `stop` [s]."""

    rate: Coordinate | Vector
    start: Time = 0.0
    stop: Time | None = None


class Keyframes(Kind, tag="keyframes"):
    """Values [m or rad] at given times [s], linear in between."""

    times: Annotated[tuple[Time, ...], Meta(min_length=2)]
    values: Table


class Ramps(Kind, tag="ramps"):
    """Rates [m/s or rad/s] at given times [s], linear in between, at rest before and after."""

    times: Annotated[tuple[Time, ...], Meta(min_length=2)]
    rates: Table


class Oscillation(Kind, tag="oscillation"):
    """amplitude (sin(2 pi frequency s + phase) - sin(phase)), s the time since `start`."""

    amplitude: Coordinate | Vector              # [m or rad]
    frequency: NotNegative                      # [1/s]
    phase: Angle = 0.0                          # [degrees]
    start: Time = 0.0
    stop: Time | None = None


Schedule = Steady | Keyframes | Ramps | Oscillation


class Motion(Record):
    """A rigid motion: first turned by `angle`, then shifted and rotated on schedules."""

    translation: Schedule | None = None         # vectors
    rotation: Schedule | None = None            # numbers [rad], about `axis` in 3D
    center: Vector | None = None                # of the rotation [m]; the world's origin
    axis: Vector | None = None
    angle: Angle = 0.0                          # how the shape stands at the start [degrees]


class Collider(Record):
    """A shape that constrains the velocities of the nodes it contains."""

    shape: Analytic
    kind: Literal["sticky", "slip", "separate", "noslip"] = "sticky"
    friction: Friction = 0.0
    inside: bool = False                        # a container: the nodes outside of the shape
    motion: Motion = Motion()
    name: str = ""


class Fixed(Record):
    """A region whose nodes have prescribed velocities, zero without a motion."""

    region: Analytic
    motion: Motion = Motion()
    inside: bool = False
    follows: bool = True                        # the region moves along
    since: Time = 0.0                           # it holds from here
    until: Time | None = None                   # ... to here; released afterwards
    name: str = ""


class Walls(Record):
    """Walls along the axes, counted in nodes: index < low or > high is in a wall."""

    low: WallNodes | None = None
    high: WallNodes | None = None
    kind: Literal["sticky", "slip", "separate", "noslip"] = "separate"
    friction: Friction = 0.0


class BodyContact(Record):
    """The rule between each two of some bodies (see `body_contact`); others share velocities."""

    bodies: tuple[Name, ...]                    # names
    friction: Friction = 0.0
    kind: Literal["separate", "stick"] = "separate"


class Clip(Record):
    """A box in which the particles' positions are kept, their velocities unchanged (NCLAW-sim)."""

    lower: Vector
    upper: Vector


class Scheme(Record):
    """The scheme of the transfer between particles and grid (see `explicit.Scheme`)."""

    degree: int = 2
    transfer: str | None = None                 # none: "mls", of an implicit step "apic"
    flip: Share = 1.0
    rpic: Share = 0.0
    relaxation: NotNegative = 0.0               # [s]
    mass_eps: NotNegative = 0.0                 # [kg]
    gravity_on_empty: bool = False
    f_bar: bool = False
    gimp: NotNegative = 0.0                     # particles per cell and axis
    precision: Literal["double", "single"] = "double"

    def __post_init__(self):
        self.for_integrator("explicit")

    def for_integrator(self, integrator):
        """Return the `explicit.Scheme` of a step by an integrator."""
        values = {name: getattr(self, name) for name in self.__struct_fields__}
        if self.transfer is None:
            values["transfer"] = "mls" if integrator == "explicit" else "apic"
        return ExplicitScheme(**values)


class Solver(Record):
    """Options of implicit steps; the defaults are those of the method (see `hot.methods`)."""

    as_released: bool = False                   # defaults of the authors' public code instead
    eps: Positive | None = None                 # tolerance of the scaled gradient
    displacement_tolerance: NotNegative | None = None       # error of a step [dx]
    start: Literal["gravity", "zero"] | None = None         # of the increment
    balance: Literal["rigid", "none"] | None = None         # of rigid motions
    return_map: Literal["lagged", "implicit"] | None = None     # of plastic flow
    creep: Positive | None = None               # sliding in a step, friction is not full below [dx]
    window: Natural | None = None               # pairs of L-BFGS
    rebuild_every: Natural | None = None        # steps between Hessians of L-BFGS
    rebuild_when: Literal["never", "shortened", "stale"] | None = None
    max_iterations: Count | None = None
    max_cg_iterations: Count | None = None      # of a linear solve
    flexible: bool | None = None                # CG for a preconditioner that varies
    levels: Count | None = None                 # of multigrid
    implementation: Literal["blocks", "scipy"] | None = None

    def given(self):
        """Return the keys that are given, as a dictionary."""
        values = {name: getattr(self, name) for name in self.__struct_fields__}
        del values["as_released"]
        return {name: value for name, value in values.items() if value is not None}


class Limits(Record):
    """Limits within which a run is healthy (see `monitor.Limits`)."""

    cfl: Positive = 1.0
    J: tuple[Positive, Positive] = (1e-3, 1e3)
    growth: NotNegative = 0.5


class Scene(Record, dict=True):
    """A scene: all data that determine a run, apart from the program.

    `validate_scene` stores under `parts` the objects that it built to check the scene.
    """

    dim: Literal[2, 3]
    dx: Length                                  # grid spacing [m]
    body: Annotated[tuple[Body, ...], Meta(min_length=1)]
    title: str = ""
    gravity: Vector | None = None               # [m/s^2]; none
    dt: Positive | None = None                  # fixed time step [s], or
    cfl: Annotated[float, Meta(gt=0, le=10)] | None = None      # share of the stable one; 0.5
    longest: Positive | None = None             # bound of a time step that is not fixed [s]
    steps: Count | None = None                  # length of the run, or
    end: Positive | None = None                 # [s]
    every: Count | None = None                  # steps between frames, or
    interval: Positive | None = None            # [s]
    seed: Seed = 0
    unstable: Literal["refuse", "allow"] = "refuse"
    scheme: Scheme = Scheme()
    integrator: str = "explicit"                # or the word of an implicit method
    solver: Solver | None = None
    collider: tuple[Collider, ...] = ()
    fixed: tuple[Fixed, ...] = ()
    sink: tuple[Sink, ...] = ()
    walls: Walls | None = None
    boundary: Literal["nodes", "surface"] = "nodes"     # where the conditions of colliders hold
    contact: tuple[BodyContact, ...] = ()           # of bodies with each other
    clip: Clip | None = None
    limits: Limits = Limits()
    quantity: tuple[Quantities, ...] = ()       # of interest; no run depends on them

    @property
    def parts(self):
        """Return the `builder.SceneParts` of a scene that was validated, else None."""
        return vars(self).get("parts")

    @property
    def step_scheme(self):
        """Return the `explicit.Scheme` of the scene's steps."""
        return self.scheme.for_integrator(self.integrator)
