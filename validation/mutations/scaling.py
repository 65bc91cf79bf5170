"""Scale the numbers of nested records, for mutations of scenes and studies."""

import msgspec
import numpy as np

COUNTED = ("steps", "every")        # integers that may be scaled too
FIXED = ("dim", "seed", "low", "high", "interval", "end", "scheme")


def scaled(value, factor, name=""):
    """Return a record, tuple, array or number with all its real numbers, and the counts in COUNTED,
    times a factor; others, and what has a name in FIXED, stay.
    """
    if name in FIXED:
        return value
    if isinstance(value, msgspec.Struct):
        return msgspec.structs.replace(value, **{
            field: scaled(getattr(value, field), factor, field)
            for field in value.__struct_fields__})
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(scaled(a, factor, field)
                             for field, a in zip(value._fields, value, strict=True)))
    if isinstance(value, tuple):
        return tuple(scaled(a, factor, name) for a in value)
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        return factor * value
    if name in COUNTED and isinstance(value, int):
        return round(factor * value) + 1
    return factor * value if isinstance(value, float) else value
