"""The tables of a scene that say what a body is made of: an elastic law and a return map, by name
and parameters, or both learned, from a file of weights.
"""

from typing import Annotated

from msgspec import Meta

from ..materials import LAWS, make_flow, make_law
from ..materials.learned import admissible, learned_flow, learned_law, network, weights
from ..nclaw.bodies import dim_of
from ..nclaw.strain_watch import known
from ..shapes.quantities import Record, Sha256

Number = Annotated[float, Meta(ge=-1e30, le=1e30)]
NEURAL = "neural"       # the law whose parameters are a file
LEARNED = *network.STRESSES, *network.CORRECTIONS, *admissible.MADE       # kinds that it may hold


class Flow(Record):
    """A return map by its name in `materials.FLOWS`, and those parameters that it takes."""

    type: str
    friction_angle: Number | None = None        # [degrees]
    s_min: Number | None = None
    s_max: Number | None = None
    sigma_y: Number | None = None               # [Pa] in uniaxial tension, or
    tau_y: Number | None = None                 # [Pa] as Frobenius norm of the deviator
    xi: Number | None = None
    theta: Number | None = None                 # [Pa]
    eta: Number | None = None                   # [Pa s]


class Material(Record):
    """An elastic law by its name in `materials.LAWS`, those parameters it takes, a return map; or
    "neural", and the file that holds both.
    """

    law: str
    E: Number | None = None                     # [Pa]
    nu: Number | None = None
    lam: Number | None = None                   # [Pa]
    weights: str | None = None                  # file of trained laws (see nclaw.weights)
    sha256: Sha256 | None = None                # of what that file must hold
    flow: Flow = Flow(type="none")

    def __post_init__(self):
        if self.law == NEURAL:
            self.trained()
        elif self.law in LAWS:
            self.elastic()
        else:
            raise ValueError(f"law {self.law!r}: expected one of {', '.join((*LAWS, NEURAL))}")

    @property
    def is_neural(self):
        """Whether its laws are learned."""
        return self.law == NEURAL

    def elastic(self):
        """The elastic law. Raises ValueError for a name or parameter that does not fit."""
        if self.is_neural:
            return learned_law(self.trained().elastic)
        return make_law(self.law, **_given(self, "law", "flow"))

    def flowing(self, dim):
        """The return map in `dim` dimensions; errors as `elastic`."""
        if self.is_neural:
            return learned_flow(self.trained(dim).plastic)
        parameters = _given(self.flow, "type")
        return make_flow(self.flow.type, self.elastic(), dim, **parameters)

    def seen(self, dim):
        """What its laws saw in training (see `nclaw.strain_watch.known`); None where that is not
        known. Raises ValueError for weights that say something else.
        """
        return known(self.trained().about, dim) if self.is_neural else None

    def trained(self, dim=None):
        """`learned.weights.Laws` of its file. Raises ValueError for a file that holds none, or for
        other dimensions, and for keys beside it.
        """
        beside = [*_given(self, "law", "weights", "sha256", "flow")]
        beside += ["flow"] if self.flow != Flow(type="none") else []
        if beside:
            raise ValueError(f"law {NEURAL!r}: unknown parameter {', '.join(beside)}; all that it "
                             "takes is `weights`, which hold the return map too")
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
            if kind not in LEARNED:
                raise ValueError(
                    f"weights = {self.weights!r}: its {part} law is of kind {kind.__name__}; "
                    'expected networks as of the methods "ours" or "admissible"; `mpm-ref law '
                    "evaluate` runs any, and identified constants can be written here")


def _given(record, *but):
    """The keys of a record that have a value, except some."""
    values = {name: getattr(record, name) for name in record.__struct_fields__ if name not in but}
    return {name: value for name, value in values.items() if value is not None}
