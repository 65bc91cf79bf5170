"""Settings that HOT prints, as the scenes and the methods here carry them.

Spacings and numbers of particles are those of Table 2 at the profile "paper" alone (see `sizes`)
and not compared here; nor is the soft tissue of the wheel, which even the release leaves out.
"""

from mpm_ref.hot.krylov import JACOBI  # noqa: F401
