"""Types of numbers in scene records, with their bounds.

Units are SI, angles in degrees. The bounds keep every derived number far from overflow.
"""

from typing import Annotated

from msgspec import Meta, Struct

Coordinate = Annotated[float, Meta(ge=-1e9, le=1e9)]                # [m]; velocities and so on
Vector = Annotated[tuple[Coordinate, ...], Meta(min_length=2, max_length=3)]    # d numbers
Length = Annotated[float, Meta(ge=1e-9, le=1e9)]                    # [m]
Positive = Annotated[float, Meta(ge=1e-30, le=1e30)]
NotNegative = Annotated[float, Meta(ge=0, le=1e30)]
Friction = Annotated[float, Meta(ge=0, le=10)]      # a coefficient, no angle: rubber has about 1
Share = Annotated[float, Meta(ge=0, le=1)]
Angle = Annotated[float, Meta(ge=-1e6, le=1e6)]                     # [degrees]
Count = Annotated[int, Meta(ge=1, le=1_000_000_000)]
Natural = Annotated[int, Meta(ge=0, le=1_000_000_000)]
PerCell = Annotated[int, Meta(ge=1, le=64)]
Sha256 = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}\Z")]
Seed = Annotated[int, Meta(ge=0, le=2**63 - 1)]


class Record(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a scene file, immutable and without unknown keys."""


class Kind(Record, frozen=True, kw_only=True, tag_field="type"):
    """A table of a scene file whose key `type` selects its record."""
