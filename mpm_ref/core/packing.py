"""Boxes of nodes side by side in one box: on shelves, in the order of their size.

Layers follow each other along the first axis of the list `axes`, rows of a layer along the next
one, and boxes of a row along the last. A row or a layer is as thick as its thickest box. As boxes
come in decreasing order, those of a layer are about as thick.
"""

import numpy as np

from .jit import kernel


@kernel
def put_on_shelves(room, order, axes, limit, place):
    """Place the boxes one after another.

    room (n, d) is the size of each box, order (n,) their order, axes (d,) see above, limit (d,) the
    length of a row and of a layer, at least that of each box; place (n, d) becomes the first node
    of each.
    """
    d = len(axes)
    cursor, thickness = np.zeros(d, dtype=np.int64), np.zeros(d, dtype=np.int64)
    for k in order:
        for j in range(d - 1, 0, -1):
            if cursor[axes[j]] + room[k, axes[j]] > limit[axes[j]]:
                cursor[axes[j - 1]] += thickness[axes[j - 1]]
                thickness[axes[j - 1]] = 0
                for a in axes[j:]:
                    cursor[a] = 0
        place[k] = cursor
        cursor[axes[d - 1]] += room[k, axes[d - 1]]
        for a in axes[: d - 1]:
            thickness[a] = max(thickness[a], room[k, a])


def pack(room, axis):
    """Return the places (n, d) of boxes of the sizes room (n, d) that share no node; layers follow
    each other along an axis. Each place is a sum of sizes along each axis.
    """
    d = room.shape[1]
    axes = np.array([axis, *(a for a in range(d) if a != axis)])
    order = np.lexsort(-room.T[axes[::-1]])
    side = int(np.prod(room.astype(float), axis=1).sum() ** (1.0 / d)) + 1
    place = np.empty_like(room)
    put_on_shelves(room, order, axes, np.maximum(room.max(axis=0), side), place)
    return place
