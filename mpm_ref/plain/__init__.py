"""The explicit step once more, in plain NumPy: the text to read first, and what the kernels are
tested against.

Nothing here is shared with `core` or `materials`: B-splines come from their recursion, singular
values from rotations, stresses from principal stretches. Functions take arrays with the particle
first, in any dimension and any floating type, `np.longdouble` included; nothing is changed in
place. Read in this order: `spline`, `transfer`, `laws`, `flows`, `walls`, `step`.
"""
