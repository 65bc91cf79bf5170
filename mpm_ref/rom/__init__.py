"""Reduced-order models of the material point method: few latent coordinates instead of particles.

A field gives the position of every material point of the body from r latent coordinates xhat, as
a map g(X; xhat) (LDM-eq14), and its stress. `fields` has the interface and its implementations,
`step` the reduced step of LDM and NSF, which knows no more of a field than that interface.
README.md maps the package from the top down.
"""
