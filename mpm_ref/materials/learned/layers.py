"""Outputs of a trained network for one point, in the precision of its weights.

    a_0 = a,   a_{l+1} = gelu(a_l W_l + b_l),   y = a_{L-1} W_{L-1} + b_{L-1}

Every sum starts at its bias and goes over the inputs in their order. Two blocks of 32 outputs, of 8
in layers of fewer, run side by side: where there are vector registers for them, as with AVX-512,
nothing is stored before their sums are complete. The last block ends at the last output, so that it
may compute some outputs once more, to the same bits. Layers of fewer than 8 outputs are summed in
memory. No point allocates anything, nor counts references, unless a layer is wider than the room on
the stack.

In double, gelu(z) = z (1 + erf(z / sqrt 2)) / 2 as the C library has it. In single it is

    gelu(z) = z (1/2 + x P(t) / Q(t)),    x = min(max(z, -FAR), FAR),    t = max(|x|, NEAR)^2

for which the compiler uses vector registers, too: no branch, no call. P and Q are our own fit of x
P / Q to erf(x / sqrt 2) / 2 on [0, FAR], by least squares whose weights grow where errors are
large; its largest error is 8e-9, and 1.9e-7 as computed in single, that of gelu |z| times as much.
NEAR is far below what t adds to P and Q. Near rest, without it, terms of P would be subnormal
numbers, which take many times as long.
"""

from math import erf, sqrt

import numpy as np

from ...core.jit import borrowing, kernel
from ...core.lanes import is_single, lanes, lanes_as, plus_product, put_lanes, stack

ROOT = sqrt(0.5)
WIDTH = 256             # of the widest layer whose numbers have room on the stack
ROOM = 2 * WIDTH
MANY, FEW = 32, 8       # sums in a block
NEAR, FAR = 1e-9, 5.5
P = (0.39894223462017825, 0.03385278660404083, 0.004677269627888337, 0.00016882714705220768,
     6.352132194047969e-06, 2.27493234151993e-08)
Q = (1.0, 0.25152227036029995, 0.028645952793993016, 0.0018844531424700116,
     7.36479968304757e-05, 1.1975037649806705e-06)


@borrowing
def outputs(a, sizes, W, b):
    """Replace the first numbers of a, the inputs in double, by the outputs of a network; sizes, W
    and b as of `network.NeuralLaw`.
    """
    widest = 0
    for m in sizes:
        widest = max(widest, m)
    if widest <= WIDTH:
        pass_through(a, sizes, W, b, stack(W[0], ROOM))
    else:
        pass_through_wide(a, sizes, W, b, widest)


@kernel
def pass_through_wide(a, sizes, W, b, widest):
    """`outputs` of a network that is wider than the room on the stack."""
    pass_through(a, sizes, W, b, np.empty(2 * widest, W.dtype))


@borrowing
def pass_through(a, sizes, W, b, room):
    """`outputs`, with room for the numbers of two layers."""
    w, k, last, x, z = 0, 0, len(sizes) - 1, 0, len(room) // 2
    for i in range(sizes[0]):
        room[i] = a[i]
    for l in range(last):
        n, m = sizes[l], sizes[l + 1]
        layer(room, W, b, (n, m), (x, z, w, k))
        if l < last - 1:
            activate(room[z:z + m])
        x, z, w, k = z, x, w + n * m, k + m
    for j in range(sizes[last]):
        a[j] = room[x + j]


@borrowing
def layer(room, W, b, sizes, starts):
    """Compute the sums of a layer; starts: of its inputs and its sums in `room`, of W and of b."""
    m, k = sizes[1], starts[3]
    if m >= MANY:
        for first in range(0, m, 2 * MANY):
            i, j = min(first, m - MANY), min(first + MANY, m - MANY)
            sums(room, W, sizes, starts, (i, j), (lanes(b, k + i, MANY), lanes(b, k + j, MANY)))
    elif m >= FEW:
        for first in range(0, m, 2 * FEW):
            i, j = min(first, m - FEW), min(first + FEW, m - FEW)
            sums(room, W, sizes, starts, (i, j), (lanes(b, k + i, FEW), lanes(b, k + j, FEW)))
    else:
        sums_in_memory(room, W, b, sizes, starts)


@borrowing
def sums(room, W, sizes, starts, places, biases):
    """Compute two blocks of sums of a layer, which start at two places, from their biases."""
    (n, m), (x, z, w, _), (i, j), (s, t) = sizes, starts, places, biases
    for a in room[x:x + n]:
        s, t = plus_product(s, a, lanes_as(s, W, w + i)), plus_product(t, a, lanes_as(t, W, w + j))
        w += m
    put_lanes(room, z + i, s)
    put_lanes(room, z + j, t)


@borrowing
def sums_in_memory(room, W, b, sizes, starts):
    """Compute the sums of a layer of any size."""
    (n, m), (x, z, w, k) = sizes, starts
    for j in range(m):
        room[z + j] = b[k + j]
    for i in range(n):
        for j in range(m):
            room[z + j] += room[x + i] * W[w + i * m + j]


@kernel
def activate(z):
    """Replace each z by gelu(z)."""
    if is_single(z):
        activate_by_fit(z)
    else:
        for j in range(len(z)):
            z[j] = gelu(z[j])


@kernel
def gelu(z):
    """Return z times the normal distribution's share below z."""
    return 0.5 * z * (1.0 + erf(ROOT * z))


@kernel
def activate_by_fit(z):
    """Replace each z by gelu(z) of the fit. One text, since LLVM would pair P and Q of one z if
    they were kernels, and then not take many z at a time.
    """
    for j in range(len(z)):
        x = -FAR if z[j] < -FAR else z[j]
        x = FAR if x > FAR else x
        size = abs(x) if abs(x) > NEAR else NEAR
        t = size * size
        over = P[0] + t * (P[1] + t * (P[2] + t * (P[3] + t * (P[4] + t * P[5]))))
        under = Q[0] + t * (Q[1] + t * (Q[2] + t * (Q[3] + t * (Q[4] + t * Q[5]))))
        z[j] *= 0.5 + x * over / under
