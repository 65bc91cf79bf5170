"""Learned constitutive laws, of networks and splines, as materials."""

from .table import learned_flow, learned_law

__all__ = ["learned_flow", "learned_law"]
