"""What is worth saying of a study before fields are made of its runs."""

from ..tables import MODES

LEAST = 1e-6        # smoothing from which on runs of matter that flows did well (docs/nsf.md)


def hints(study):
    """Yield sentences."""
    fields = study.tables.map
    flowing = [body.name for body in study.base.body if body.material.flow.type != "none"]
    if fields.kind == MODES and flowing and fields.smoothing < LEAST:
        yield (f"map.smoothing = {fields.smoothing:g}, and {', '.join(flowing)} flows: runs on "
               f"such fields are often far off; try {LEAST:g} to 1, and keep what mpm-ref rom "
               "evaluate likes best")
