"""Bodies that stand for NCLaw's meshes, which are not here: capsules, balls and rings.

Each is about the origin, y upwards, with 1 the largest edge of its box, and has roughly the volume
of its mesh as sampled by the authors' release. A mesh of the user's, NAME.obj, is used instead (see
`user_meshes`).
"""

from mpm_ref.scene import Capsule, Mesh, Sphere, Torus, Transformed, Union

from ..common.user_meshes import mesh_file


def limb(start, end, radius):
    """Return a capsule."""
    return Capsule(start=start, end=end, radius=radius)


def ball(center, radius):
    """Return a ball."""
    return Sphere(center=center, radius=radius)


STAND_INS = {
    "armadillo": Union(shapes=(
        limb((0.0, -0.1, 0.0), (0.0, 0.1, 0.02), 0.17),        # trunk
        ball((0.0, 0.33, 0.04), 0.115),                          # head
        limb((0.0, 0.31, 0.1), (0.0, 0.28, 0.2), 0.04),         # snout
        limb((-0.05, 0.4, 0.0), (-0.1, 0.47, 0.0), 0.03),       # ears
        limb((0.05, 0.4, 0.0), (0.1, 0.47, 0.0), 0.03),
        limb((-0.12, 0.16, 0.0), (-0.3, 0.2, 0.08), 0.065),     # arms
        limb((0.12, 0.16, 0.0), (0.3, 0.2, 0.08), 0.065),
        limb((-0.1, -0.18, 0.0), (-0.17, -0.415, 0.04), 0.085),   # legs
        limb((0.1, -0.18, 0.0), (0.17, -0.415, 0.04), 0.085),
        limb((0.0, -0.18, -0.1), (0.0, -0.3, -0.32), 0.05),     # tail
    )),
    "bunny": Union(shapes=(
        limb((-0.05, -0.2, 0.0), (0.1, -0.16, 0.0), 0.3),       # trunk
        ball((-0.22, 0.14, 0.0), 0.19),                         # head
        limb((-0.2, 0.26, -0.07), (-0.1, 0.44, -0.12), 0.06),   # ears
        limb((-0.2, 0.26, 0.07), (-0.1, 0.44, 0.12), 0.06),
        ball((0.4, -0.34, 0.0), 0.08),                          # tail
        limb((-0.2, -0.42, -0.14), (-0.36, -0.42, -0.14), 0.08),    # feet
        limb((-0.2, -0.42, 0.14), (-0.36, -0.42, 0.14), 0.08),
    )),
    "blub": Union(shapes=(
        limb((-0.36, 0.0, 0.0), (0.1, 0.0, 0.0), 0.14),         # a fish
        limb((0.1, 0.0, 0.0), (0.36, 0.02, 0.0), 0.07),
        limb((0.36, 0.02, 0.0), (0.46, 0.16, 0.0), 0.04),       # tail fins
        limb((0.36, 0.02, 0.0), (0.46, -0.12, 0.0), 0.04),
        limb((-0.15, 0.13, 0.0), (0.02, 0.2, 0.0), 0.03),       # back fin
        limb((-0.15, -0.04, -0.1), (-0.02, -0.08, -0.22), 0.03),    # side fins
        limb((-0.15, -0.04, 0.1), (-0.02, -0.08, 0.22), 0.03),
    )),
    "spot": Union(shapes=(
        limb((-0.1, 0.0, 0.0), (0.28, 0.0, 0.0), 0.22),        # a cow
        ball((-0.32, 0.17, 0.0), 0.18),                         # head
        limb((-0.3, 0.3, -0.08), (-0.26, 0.38, -0.12), 0.04),   # horns
        limb((-0.3, 0.3, 0.08), (-0.26, 0.38, 0.12), 0.04),
        limb((-0.08, -0.1, -0.12), (-0.1, -0.34, -0.12), 0.075),    # legs
        limb((-0.08, -0.1, 0.12), (-0.1, -0.34, 0.12), 0.075),
        limb((0.26, -0.1, -0.12), (0.28, -0.34, -0.12), 0.075),
        limb((0.26, -0.1, 0.12), (0.28, -0.34, 0.12), 0.075),
    )),
    "bob": Union(shapes=(
        Torus(center=(0.0, -0.16, 0.0), major=0.34, minor=0.16, axis=(0.0, 1.0, 0.0)),  # a swim
        ball((-0.3, 0.2, 0.0), 0.15),                                   # ring with a duck's head
        limb((-0.3, -0.05, 0.0), (-0.3, 0.2, 0.0), 0.1),
        limb((-0.42, 0.17, 0.0), (-0.46, 0.17, 0.0), 0.04),             # beak
    )),
    "dragon": Union(shapes=(
        limb((-0.12, 0.0, 0.0), (0.16, -0.04, 0.0), 0.13),      # trunk
        limb((-0.16, 0.06, 0.0), (-0.28, 0.22, 0.0), 0.08),     # neck
        limb((-0.3, 0.24, 0.0), (-0.42, 0.2, 0.0), 0.08),       # head
        limb((0.2, -0.06, 0.0), (0.36, 0.06, 0.0), 0.07),       # tail
        limb((0.36, 0.06, 0.0), (0.46, 0.2, 0.0), 0.04),
        limb((-0.12, -0.06, -0.1), (-0.18, -0.24, -0.12), 0.05),    # legs
        limb((-0.12, -0.06, 0.1), (-0.18, -0.24, 0.12), 0.05),
        limb((0.16, -0.08, -0.1), (0.2, -0.24, -0.12), 0.05),
        limb((0.16, -0.08, 0.1), (0.2, -0.24, 0.12), 0.05),
    )),
    "icecream": Union(shapes=(
        ball((0.0, 0.24, 0.0), 0.26), limb((0.0, 0.0, 0.0), (0.0, -0.3, 0.0), 0.13),
        limb((0.0, -0.3, 0.0), (0.0, -0.44, 0.0), 0.06),        # on a cone
    )),
}


def toy(name, size, center=(0.5, 0.5, 0.5)):
    """Return the shape of a body [m] with a box of that largest edge: the user's mesh, or its
    stand-in.
    """
    if has_mesh(name):
        return Mesh(file=str(mesh_file("nclaw", f"{name}.obj")), size=size, center=center)
    return Transformed(shape=STAND_INS[name], scale=size, about=(0.0, 0.0, 0.0), translate=center)


def has_mesh(name):
    """Return whether a mesh of the user's is used."""
    return mesh_file("nclaw", f"{name}.obj") is not None


def body_label(name):
    """Return a body in words."""
    return name if has_mesh(name) else f"a stand-in for {name}"
