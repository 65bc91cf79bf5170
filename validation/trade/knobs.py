"""What can be traded in the explicit method: the knobs, their default, and their levels."""

from typing import NamedTuple

from mpm_ref.explicit import Scheme


class ExplicitSetting(NamedTuple):
    """One choice of all knobs."""

    transfer: str = "mls"
    flip: float = 1.0           # share of FLIP against PIC
    degree: int = 2
    cells: int = 16             # over the length of the problem
    per: int = 2                # particles per cell and direction
    sampling: str = "lattice"   # "lattice", "jittered" or "poisson"
    cfl: float = 0.5            # dt over the time in which an elastic wave crosses a cell
    storage: str = "f64"        # of the state between steps; "f32": rounded after every step

    @property
    def scheme(self):
        """The `Scheme` of the setting."""
        return Scheme(self.degree, self.transfer, flip=self.flip)

    def words(self):
        """What differs from the default, in words."""
        changed = [f"{name} = {value}" for name, value in self._asdict().items()
                   if value != getattr(DEFAULT, name)]
        return ", ".join(changed) or "the default"


DEFAULT = ExplicitSetting()

TRANSFERS = ({"transfer": "pic"}, {"transfer": "flip"}, {"transfer": "flip", "flip": 0.95},
             {"transfer": "apic"})
SAMPLINGS = ({"sampling": "jittered"}, {"sampling": "poisson"})
STORAGE = ({"storage": "f32"},)

# knob -> changes of the default; quick is a slice of what standard does.
QUICK = {
    "dt": tuple({"cfl": c} for c in (0.1, 0.8, 1.0, 1.2, 1.5)),
    "dx": tuple({"cells": n} for n in (8, 32)),
    "particles": tuple({"per": n} for n in (1, 3)),
    "sampling": SAMPLINGS,
    "degree": ({"degree": 3},),
    "transfer": TRANSFERS,
    "storage": STORAGE,
}
STANDARD = {
    "dt": tuple({"cfl": c} for c in (0.05, 0.1, 0.2, 0.8, 1.0, 1.2, 1.5)),
    "dx": tuple({"cells": n} for n in (8, 24, 32, 48, 64, 96)),
    "particles": tuple({"per": n} for n in (1, 3, 4)),
    "sampling": SAMPLINGS,
    # linear splines exist for PIC and FLIP only
    "degree": ({"degree": 3}, {"degree": 1, "transfer": "flip"}, {"degree": 1, "transfer": "pic"},
               {"degree": 3, "per": 3}),
    "transfer": TRANSFERS,
    "storage": STORAGE,
}


def settings(levels):
    """(knob, `ExplicitSetting`) of all levels, one knob at a time from the default."""
    out = [("default", DEFAULT)]
    for knob, changes in levels.items():
        out += [(knob, DEFAULT._replace(**change)) for change in changes]
    return out
