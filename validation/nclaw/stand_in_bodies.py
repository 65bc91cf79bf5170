"""Bodies that stand for NCLaw's meshes, which are not here: capsules, balls and rings.

Each is about the origin, y upwards, with 1 the largest edge of its box, and has roughly the volume
of its mesh as sampled by the authors' release. A mesh of the user's, NAME.obj, is used instead (see
`user_meshes`), if it is the release's.
"""

from math import cos, pi, sin

from mpm_ref.scene import Capsule, Mesh, Sphere, Torus, Transformed, Union

from ..common.user_meshes import mesh_file

SHA256 = {      # of the release's meshes
    "armadillo": "dc55724ad580fd3d63e22a7858fa4ed219d8526b975cfdc20dbc3c7d4921044a",
    "blub": "c00d6988859f1e33ec58796cdf8d4685cb040ceae1930ac6c9870eca9ad12c5c",
    "bob": "9aa94b89b002479b983dab1d32dd8241268cc82100a1b33940b5c2a9c38c6935",
    "bunny": "b83f4af5ac830bc7cce8dd325f60a9c467a6ff2eb095ad32584954468d495e45",
    "chocolate": "2fab043a7870fb6a9fcb6c9d85636fa9abbfa6d6fe74e1bd8b7c67b23fbd38d3",
    "dragon": "e60d815532b30dfbedb5f160967cce21b46ae4e3322f2044a3023546929b1956",
    "dragon30": "8c44aff2daf381593d0f8b3d868b85468043474b05edf1a377d5306ecdd90f47",
    "icecream": "3e3e48dc72c42864d6ef9c88be0b27780fe79171466020912b73c57653e0f692",
    "spot": "63467c2366e0879a360cffb4e6edb5b07ff8620dd1f3f5893ba5ae563a4ed838",
}


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
    "icecream": Union(shapes=(                                  # seven scoops side by side
        ball((0.0, 0.0, 0.0), 0.19), *(
            ball((0.31 * cos(k * pi / 3), 0.0, 0.31 * sin(k * pi / 3)), 0.19) for k in range(6)))),
    "chocolate": Torus(center=(0.0, 0.0, 0.0), major=0.44, minor=0.055, axis=(0.0, 1.0, 0.0)),
}
STAND_INS["dragon30"] = STAND_INS["dragon"]     # the release turns its mesh, we do not


def toy(name, size, center=(0.5, 0.5, 0.5)):
    """Return the shape of a body [m] with a box of that largest edge: the user's mesh, or its
    stand-in. Raises as `mesh_of`.
    """
    if (file := mesh_of(name)) is not None:
        return Mesh(file=str(file), size=size, center=center)
    return Transformed(shape=STAND_INS[name], scale=size, about=(0.0, 0.0, 0.0), translate=center)


def mesh_of(name):
    """Return the path of a body's mesh, or None where the user has none. Raises ValueError where
    the file is another one than the release's.
    """
    return mesh_file("nclaw", f"{name}.obj", SHA256[name])


def has_mesh(name):
    """Return whether a mesh of the user's is used. Raises as `mesh_of`."""
    return mesh_of(name) is not None


def body_label(name):
    """Return a body in words."""
    return name if has_mesh(name) else f"a stand-in for {name}"
