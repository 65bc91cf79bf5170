"""What is worth saying of a study before fields are made of its runs."""

from .nsf_tables import SIZES
from .tables import MODES


def hints(study):
    """Yield sentences."""
    fields = study.tables.map
    flowing = [body.name for body in study.base.body if body.material.flow.type != "none"]
    if fields.kind == MODES and flowing and fields.smoothing <= SIZES["smoothing"]:
        yield (f"map.smoothing = {fields.smoothing:g} is for elastic matter, and that of "
               f"{', '.join(flowing)} flows: reduced runs are often far off then. Try 1e-6 to 1, "
               "and keep what mpm-ref rom evaluate likes best, first with all points as samples")
