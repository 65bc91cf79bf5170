"""Reduced-order models of the material point method: few latent coordinates instead of particles.

A *map* g(X; xhat) gives the position of every material point X of the body from r latent
coordinates xhat (LDM-eq14). It is any object with

    dim, r                              numbers of axes and of latent coordinates
    place(X, xhat)                      x (n, d) [m] of points X (n, d) at rest
    derivatives(X, xhat)                x, F = dg/dX (n, d, d) and dg/dxhat (n, d, r)
    velocity(X, xhat, vhat)             dg/dxhat vhat (n, d) [m/s]

`decoder` is the learned one, `modes` the linear one that is the honest baseline, `affine` an exact
one for tests. Which points are looked at, and how latent coordinates follow from them, is for
`samples`, `lagrangian`, `eulerian`, `projection` and `step`, which know no more of a map than this.

Where plasticity or a tear leaves F behind, stress and affine field are fields of their own (NSF):
`inferred` is the step, `learned` and `spanned` are such fields, as networks and as sums of modes.
"""
