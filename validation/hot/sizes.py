"""The scenes of HOT at three sizes: their grid spacings and numbers of particles."""

from math import inf
from typing import NamedTuple

from mpm_ref.scene.streams import stream_of
from mpm_ref.streams import blocks_until

from ..common.scenes import catalogue_scene, with_

AFFORDABLE = ("faceless", "wheel")      # scenes whose entire run at the printed size takes minutes
FILL = 0.87         # of the release's particles per cell, by the numbers of Table 2 where shapes
                    # are known (Chain 308 000, Boards 188 000), as for LDM-tab2-sampling


class Size(NamedTuple):
    """Grid spacing of a scene at each profile [m]; None where the paper prints none."""

    quick: float            # 3000 to 6000 particles, as the scene is catalogue_scene; of what is
                            # poured, those of the first 0.6 s count
    standard: float         # 15 000 to 60 000 likewise
    paper: float | None


SIZES = {
    "hot_aluminium": Size(0.029, 0.016, None),
    "hot_armacat": Size(0.17, 0.1, 0.04),
    "hot_boards": Size(0.025, 0.014, 0.007),
    "hot_boxes": Size(0.045, 0.025, 0.02 / 2.48),
    "hot_chain": Size(0.04, 0.022, 0.01),
    "hot_donut": Size(0.0215, 0.012, 0.0075 / 1.32),
    "hot_faceless": Size(0.028, 0.015, 0.01),
    "hot_sauce": Size(0.03, 0.018, 0.015),
    "hot_stiffness": Size(0.03, 0.016, 0.0075),
    "hot_twist": Size(0.036, 0.02, 0.01),
    "hot_wheel": Size(0.025, 0.014, 0.005),
}


def sized(name, profile, **changes):
    """Return the scene ``scenes/<name>.toml`` at a size of `SIZES`, with other keys replaced.

    Each body keeps its particles per cell. Raises ValueError for an unknown name or profile, and
    where the paper prints no size.
    """
    if name not in SIZES or profile not in Size._fields:
        raise ValueError(f"sized({name!r}, {profile!r}): expected one of {', '.join(SIZES)} and "
                         f"one of {', '.join(Size._fields)}")
    dx, scene = getattr(SIZES[name], profile), catalogue_scene(name, **changes)
    if dx is None:
        raise ValueError(f"{name}: the paper prints no size; take 'standard'")
    finer = (scene.dx / dx) ** scene.dim
    return with_(scene, dx=dx, body=tuple(_refined(body, finer) for body in scene.body))


def _refined(body, factor):
    """Return a body with `factor` times its particles."""
    return with_(body, sampling=with_(body.sampling, count=round(body.sampling.count * factor)))


def entered(body, t=inf):
    """Return the number of particles of a scene's body that have entered by time t [s]: all at
    once, or block by block from a source.
    """
    if body.source is None:
        return body.sampling.count
    if t < body.source.start:
        return 0
    v, length, stop = stream_of(body)
    period = length / float(v @ v)**0.5
    return body.sampling.count * blocks_until((body.source.start, period), stop, t)
