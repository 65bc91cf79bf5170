"""Reduced fields: position, and stress and affine velocity field, from a few latent coordinates."""
