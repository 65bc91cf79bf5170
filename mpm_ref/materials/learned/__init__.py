"""Learned constitutive laws: networks and splines as materials, without PyTorch.

A learned law is a material like those of `mpm_ref.materials`: a NamedTuple of its numbers, which
kernels are compiled for, whose file registers its functions with the names of `core.law` at its
end. A file of weights (`weights`) holds the layers of an elastic law and of a flow, and the kind of
each, a record that says what the layers mean; `table` lists the kinds.

    kind                    record of constants that is stored with the layers
    build_law, build_flow   make the law or the flow of `LawWeights`
    kirchhoff               tau of F, of all elastic laws; psi too, where there is an energy
    stiffness, moduli_at_rest   of laws that runs of scenes may use (`LearnedEntry.in_scenes`)
    returned, intact        F of the trial F, of flows: no function of singular values alone

| file | elastic laws | flows |
|---|---|---|
| `network`, `layers`, `network_adjoint` | networks of `invariants` (answers: `response`) | too |
| `energetic`, `contraction` | an energy of four measures | a contraction of strain |
| `stretch_network`, `spline` | networks and splines in stretches (`principal`) | |

All compute in double, but that layers of `network` may be in single (`learned_law`).

A learned law differs from the others in four things: it is for one number of dimensions, it has no
differential (no implicit steps), its adjoint by F is at hand for whole arrays alone (`pull_back`)
unless it is a network of F (`network_adjoint`), and it knows the strains that it was trained on
(`strain_range`).
"""

from .table import learned_flow, learned_law

__all__ = ["learned_flow", "learned_law"]
