"""Whether a reduced run with inferred stress is still where its fields have learned something: the
first and the fourth of the questions of `rom.study.watch`, with its bound, which was chosen on maps
of LDM.
"""

from typing import NamedTuple

import numpy as np

from ..cubature import misfit
from ..extrapolation import BEYOND, trained_extent
from ..fields.pod_fields import Spanned
from .watch import WORDS

SPARSE = 0.74       # of `rom.cubature.misfit`, from runs of jelly cube and metal frame


class Sight(NamedTuple):
    """A state of a reduced run, looked at."""

    beyond: float       # distance of xhat from the trained ones, over their largest gap
    blind: int          # r less the rank of dg/dxhat at the samples

    @property
    def why(self):
        """What is out of bounds: names of fields, none where all is well."""
        out = {"beyond": not self.beyond <= BEYOND, "blind": self.blind > 0}
        return tuple(name for name, is_out in out.items() if is_out)

    @property
    def said(self):
        """The same in words."""
        return "; ".join(WORDS[name].format(**self._asdict()) for name in self.why)


def trained(fields, xhat):
    """`Extent` of the latent coordinates xhat (s, k + 1, r) of training runs. Raises ValueError
    where these do not differ.
    """
    return trained_extent(fields, np.arange(len(fields.X)), xhat)


def sparse(fields, chosen):
    """The warning, before a run, about `Chosen` samples that tell too little; or none. Networks
    know no modes: nothing is said of their samples.
    """
    left, samples = chosen.misfit, chosen.points        # of weights; NaN without
    if chosen.w is None and isinstance(fields, Spanned):
        left = misfit(fields.U, fields.r, samples)
    if left > SPARSE:
        yield (f"the {len(samples)} samples leave {100.0 * left:.0f} % of the products of the "
               f"modes, and most runs whose samples left more than {100.0 * SPARSE:.0f} % went "
               "wrong (docs/howto/reduced-model.md); give [run] more of them, or another seed")


def look(extent, at, report):
    """`Sight` of a `Latent`, reached by a step with a `Report`; None at the start."""
    blind = 0 if report is None else len(at.xhat) - report.rank
    return Sight(float(extent.beyond(at.xhat)), blind)


def sight(rows, k):
    """`Sight` of frame k, from the rows of a results file."""
    blind = rows["xhat"].shape[1] - int(rows["rank"][k]) if k else 0
    return Sight(float(rows["beyond"][k]), blind)
