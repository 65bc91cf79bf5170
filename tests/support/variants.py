"""Variants of a test: a few run in `make test`, the others in `make test-slow`, since each takes
seconds to compile its kernels.
"""

import pytest


def slow_but(variants, *fast):
    """Return the variants as parameters of a test, marked slow but for those that are in `fast`.

    Raises ValueError for one in `fast` that is no variant.
    """
    variants = list(variants)
    unknown = [one for one in fast if one not in variants]
    if unknown:
        raise ValueError(f"{unknown}: expected some of {variants}")
    return [one if one in fast else pytest.param(one, marks=pytest.mark.slow) for one in variants]
