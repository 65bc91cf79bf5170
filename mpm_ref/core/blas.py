"""BLAS on one thread: several give other bits, and spin between calls."""

import numpy  # noqa: F401  its BLAS, and SciPy's, must be there before they are listed
import scipy.linalg  # noqa: F401
from threadpoolctl import ThreadpoolController

POOLS = ThreadpoolController()


def one_thread():
    """A context in which products and factorisations run on the calling thread alone; the limit
    holds for the whole process.
    """
    return POOLS.limit(limits=1, user_api="blas")
