"""One step of MPM in plain NumPy: the text to read first, and the reference of the kernels' tests.

Every function is one equation of the papers, cited by its id (docs/reference/equations.md), in the
symbols of docs/explanation/notation.md. Arrays have the particle first, in any space dimension d;
nothing is changed in place.

The modules share nothing with `core` or `materials`: B-splines come from their recursion, singular
values from Jacobi rotations, stresses from principal stretches. Every function works in any
floating type, `np.longdouble` included.

Read them in this order: `spline` and `gimp` (weights), `transfer` (the sums between particles and
nodes), `laws` (elasticity), `flows` (plasticity), `boundary` (contact at the nodes), `surface`
(contact between them), `body_contact` (of bodies with each other), `step` (one explicit step),
`potential` (what an implicit step minimises); `tensors` has the singular value decomposition.
"""
