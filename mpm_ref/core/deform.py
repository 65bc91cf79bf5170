"""Deformation, return map and stress of every particle: one pass, one SVD at most.

    F_trial = (I + dt L) F,   F = project(F_trial),   tau = kirchhoff(F)

as in NSF-alg-mpm step 3, LDM-sec2.2-Frate and NCLAW-alg1.
Five passes, by what the law needs: J alone (no F is carried), F without a return map, F with
one. Return maps act on the singular values: F_trial = U diag(s) V^T becomes U diag(s_new) V^T,
and tau = U diag(kirchhoff_hat(s_new)) U^T. The fourth is for those that act on the whole of F.
The fifth is for radial return maps on Hencky's law, which need no singular values while strains
are moderate: eps = log(F_trial F_trial^T)/2 becomes eps_new, F = exp(eps_new - eps) F_trial.
"""

from math import sqrt

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .law import (
    intact,
    kirchhoff,
    kirchhoff_hat,
    kirchhoff_of_strain,
    plastic_strain,
    pressure,
    project,
    returned,
)
from .logarithm import LEAST_STRETCH, exponential, hencky_strain
from .spectral import rotation, svd
from .tensor import (
    det,
    identity,
    inner,
    lin,
    mat,
    mlin,
    mm,
    mmt,
    number,
    plus_diagonal,
    put_mat,
    scale,
    scale_columns,
    trace,
)


@kernel
def growth(L, p, dt, like):
    """I + dt L_p."""
    return mlin(1.0, identity(like), dt, mat(L, p, like))


@kernel
def deform_fluid(particles, law, dt, like, bounds):
    """J <- det(I + dt L) J, tau = pressure(J) I."""
    for p in range(bounds[0], bounds[1]):
        J = particles.F[p] * det(growth(particles.L, p, dt, like))
        particles.F[p] = J
        particles.tau[p] = pressure(J, law)


@kernel
def deform_elastic(particles, law, dt, like, bounds):
    """F <- (I + dt L) F, tau = kirchhoff(F)."""
    for p in range(bounds[0], bounds[1]):
        F = mm(growth(particles.L, p, dt, like), mat(particles.F, p, like))
        tau = kirchhoff(F, law)
        put_mat(particles.F, p, F)
        put_mat(particles.tau, p, tau)


@kernel
def deform_plastic(particles, law, flow, dt, like, bounds):
    """F <- U diag(s') V^T of (I + dt L) F = U diag(s) V^T with s', y' = project(s, y)."""
    for p in range(bounds[0], bounds[1]):
        F = mm(growth(particles.L, p, dt, like), mat(particles.F, p, like))
        F, tau, y = principal_return(F, recall(particles.y, p), dt, law, flow)
        remember(particles.y, p, y)
        put_mat(particles.F, p, F)
        put_mat(particles.tau, p, tau)


@kernel
def deform_radial(particles, law, flow, dt, like, bounds):
    """F <- exp(eps' - eps) F of (I + dt L) F with eps' the radial return of eps; or as
    `deform_plastic`, where strains are large or singular values may need a lift to s_min.
    """
    for p in range(bounds[0], bounds[1]):
        F = mm(growth(particles.L, p, dt, like), mat(particles.F, p, like))
        y = recall(particles.y, p)
        eps, moderate = hencky_strain(F)
        if moderate and flow.s_min < LEAST_STRETCH:
            F, tau, y = radial_return(F, eps, y, law, flow)
        else:
            F, tau, y = principal_return(F, y, dt, law, flow)
        remember(particles.y, p, y)
        put_mat(particles.F, p, F)
        put_mat(particles.tau, p, tau)


@kernel
def principal_return(F, y, dt, law, flow):
    """F, tau and y after a return map of singular values."""
    U, s, V, _ = svd(F)
    s, y = project(s, y, dt, law, flow)
    tau = kirchhoff_hat(s, law)
    tau = lin(intact(y, flow), tau, 0.0, tau)
    return mmt(scale_columns(U, s), V), mmt(scale_columns(U, tau), U), y


@kernel
def radial_return(F, eps, y, law, flow):
    """F, tau and y after a radial return map of the strain eps of F."""
    tr = trace(eps)
    d = number(len(F), tr)
    eps_hat = plus_diagonal(eps, -tr * (1.0 / d))
    size = sqrt(inner(eps_hat, eps_hat))
    dgamma, y, released = plastic_strain(d, tr, size, y, law, flow)
    if released:
        return rotation(F), scale(0.0, eps), y
    if dgamma > 0.0:
        flowed = scale(-dgamma / size, eps_hat)
        F, eps = mm(exponential(flowed, dgamma), F), mlin(1.0, eps, 1.0, flowed)
    return F, kirchhoff_of_strain(eps, law), y


@kernel
def deform_full(particles, law, flow, dt, like, bounds):
    """F <- returned((I + dt L) F), tau = kirchhoff(F)."""
    for p in range(bounds[0], bounds[1]):
        F = returned(mm(growth(particles.L, p, dt, like), mat(particles.F, p, like)), flow)
        tau = kirchhoff(F, law)
        put_mat(particles.F, p, F)
        put_mat(particles.tau, p, tau)


@kernel
def stress(particles, law, flow, like, bounds):
    """tau = kirchhoff(F) of the state as it stands (the first step of a run)."""
    for p in range(bounds[0], bounds[1]):
        tau = kirchhoff(mat(particles.F, p, like), law)
        put_mat(particles.tau, p, mlin(intact(recall(particles.y, p), flow), tau, 0.0, tau))


@kernel
def stress_fluid(particles, law, bounds):
    """tau = pressure(J) I of the state as it stands."""
    for p in range(bounds[0], bounds[1]):
        particles.tau[p] = pressure(particles.F[p], law)


@kernel
def recall(y, p):
    """History of particle p; 0 where none is kept."""
    if y.ndim == 1:
        return y[p]
    else:
        return 0.0


@kernel
def remember(y, p, value):
    """Store the history of particle p where it is kept."""
    if y.ndim == 1:
        y[p] = value


@parallel_if_many
def fluid(particles, law, dt, like):
    """`deform_fluid` for all particles. `like` is any tuple of length d."""
    for c in prange(CHUNKS):
        deform_fluid(particles, law, dt, like, chunk(c, len(particles.x)))


@parallel_if_many
def elastic(particles, law, dt, like):
    """`deform_elastic` for all particles. `like` is any tuple of length d."""
    for c in prange(CHUNKS):
        deform_elastic(particles, law, dt, like, chunk(c, len(particles.x)))


@parallel_if_many
def plastic(particles, law, flow, dt, like):
    """`deform_plastic` for all particles. `like` is any tuple of length d."""
    for c in prange(CHUNKS):
        deform_plastic(particles, law, flow, dt, like, chunk(c, len(particles.x)))


def is_radial(law, flow):
    """Return whether `radial` is for the law and the flow: it has their formulas in strains."""
    return type(law) in kirchhoff_of_strain.methods and type(flow) in plastic_strain.methods


@parallel_if_many
def radial(particles, law, flow, dt, like):
    """`deform_radial` for all particles. `like` is any tuple of length d."""
    for c in prange(CHUNKS):
        deform_radial(particles, law, flow, dt, like, chunk(c, len(particles.x)))


@parallel_if_many
def full(particles, law, flow, dt, like):
    """`deform_full` for all particles. `like` is any tuple of length d."""
    for c in prange(CHUNKS):
        deform_full(particles, law, flow, dt, like, chunk(c, len(particles.x)))


# The stress at the start is computed once a run: a parallel driver takes longer to compile than it
# saves.

def initial_stress(particles, law, flow, like):
    """`stress` for all particles. `like` is any tuple of length d."""
    stress(particles, law, flow, like, (0, len(particles.x)))


def initial_pressure(particles, law):
    """`stress_fluid` for all particles."""
    stress_fluid(particles, law, (0, len(particles.x)))
