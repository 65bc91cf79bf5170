"""The bodies of HOT's release in its scenes, filled from surface meshes of the user's.

`python -m validation.hot.real_bodies FOLDER [SCENE...]` writes scenes at the printed size, with
their particles, for `mpm-ref run`, which then needs neither the meshes nor trimesh.

Hashes are those of the files in the public release, places and particles per cell those of its
scenes. There a body from a mesh has the mesh's vertices as particles before those that fill it, and
each has the volume dx^3/per_cell: bodies whose mesh is fine against the grid are heavier than their
volume, the armadillo 2.2 times. The trampoline, whose volume a formula gives, shares that volume
among all its particles. All this is done `as_released`; otherwise vertices are no particles, and
particles share the mesh's volume. In either case bodies overlap as they do in the release, and the
wheel reaches into its floor.
"""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from mpm_ref.sampling import Points, Poisson, Regular, sample
from mpm_ref.scene import Arrays, Cylinder, Mesh
from mpm_ref.scene.toml import dumps
from mpm_ref.shapes.inside import solid
from mpm_ref.shapes.mesh import read_triangles

from ..common.scenes import with_
from ..common.user_meshes import VARIABLE, mesh_file
from .sizes import FILL, sized


class RealBody(NamedTuple):
    """A body of the release: its mesh, its place and its particles."""

    file: str
    sha256: str
    shift: tuple            # from the file's coordinates to the scene's [m]
    per_cell: int           # particles in a cell, of which there are `sizes.FILL`
    shares: bool            # particles share the body's volume also in the release
    replaces: tuple         # the bodies that stand for it


class FilledBody(NamedTuple):
    """A body's particles, and what they came from."""

    points: Points          # first the vertices
    vertices: int           # that are particles
    volume: float           # of the mesh [m^3]


BODIES = {
    "armacat": {
        "armadillo": RealBody(
            "Armadillo.obj", "5c111412b2650300d904e935f7b817a5063c7d763fbf7e72f1865e61a8c3833b",
            (10.0, 10.45, 10.6), 8, False, ("armadillo",)),
        "trampoline": RealBody(
            "cylinder.obj", "82f2f12ab3f862053e07efcaf078e407c5be278acd49c5a5db18e65690053d89",
            (10.0, 10.0, 10.0), 16, True, ("trampoline",)),
        "cat": RealBody(
            "luckyCat20K.obj", "8e2e72651b5cd5f11d60bc3f84e0a3571e984ea6b13bb6bf89b35193ef643f6f",
            (10.0, 11.3, 10.0), 8, False, ("cat",)),
    },
    "boxes": {
        "metal": RealBody(
            "metal_middle.obj", "98e4c293c8fb0e092173219371772f195a79a2debe14c254aff7e546f55fa062",
            (0.0, 0.0, 0.0), 8, False, ("metal",)),
    },
    "donut": {
        "bar": RealBody(
            "bar.obj", "0fcaf1a6e990402e85df456fbb81f5fbc69d925d8466afe937c98463df4afbed",
            (0.0, 0.0, 0.0), 8, False, ("left bar", "right bar")),
    },
    "wheel": {
        "wheel": RealBody(
            "wheel.obj", "11ba54c57384a039e4285f678a54735ca71f4a30d6adc796091f49498327ddf0",
            (1.1, 1.1, 1.1), 12, False, ("wheel",)),
    },
}
COLLIDERS = {       # of the release, where the stand-in's scene has another: it stands upright
    "wheel": {"press": Cylinder(start=(1.1, 1.6, 1.1), end=(1.1, 2.6, 1.1), radius=0.08)}}


def absent(name):
    """Return the reason for which a scene runs on stand-ins, empty where all its meshes are there.

    Raises ValueError where a file is another one than that of the release.
    """
    missing = [real.file for real in BODIES.get(name, {}).values()
               if mesh_file("hot", real.file, real.sha256) is None]
    if name not in BODIES:
        return "no meshes of this scene are known"
    return f"{VARIABLE} names no folder with hot/{missing[0]}" if missing else ""


def bodies_text(name):
    """Return in a sentence what a scene's bodies are."""
    if reason := absent(name):
        return f"bodies stand for the release's: {reason}"
    files = ", ".join(f"{body} ({real.file})" for body, real in BODIES[name].items())
    return f"bodies from meshes of the release: {files}"


def with_real_bodies(name, scene, folder):
    """Return a scene with the release's bodies where all its meshes are there, else as it is; see
    `real_scene`.
    """
    return scene if absent(name) else real_scene(name, scene, folder)


def filled(real, dx, seed, as_released=True):
    """Return a `RealBody` filled for a grid spacing dx [m] as a `FilledBody`."""
    file = mesh_file("hot", real.file, real.sha256)
    body = solid(Mesh(file=str(file)))
    x = sample(Poisson(count=fill_count(body.volume, real, dx)), body, dx, seed).x
    corners = vertices(file) if as_released else np.empty((0, 3))
    x = np.concatenate([corners, x]) + real.shift
    each = dx**3 / real.per_cell if as_released and not real.shares else body.volume / len(x)
    return FilledBody(Points(x, np.full(len(x), each)), len(corners), body.volume)


def fill_count(volume, real, dx):
    """Return the number of particles that fill a volume [m^3]."""
    return round(FILL * volume * real.per_cell / dx**3)


def vertices(file):
    """Return the places (N, 3) of a mesh's vertices, each once [m]."""
    return np.unique(read_triangles(file).reshape(-1, 3), axis=0)


def real_scene(name, scene, folder, as_released=True):
    """Return a scene (of `sizes.sized`) with the release's bodies, its grid spacing as it is.

    Their particles are written to `folder` as ``<name>-<body>.npz``. Folder and meshes must be
    there.
    """
    reals, bodies = BODIES[name], []
    replaced = {old: new for new, real in reals.items() for old in real.replaces}
    for k, body in enumerate(scene.body):
        new = replaced.get(body.name)
        if new is None:
            bodies.append(body)
        elif body.name == reals[new].replaces[0]:
            found = filled(reals[new], scene.dx, [scene.seed, k], as_released)
            file = Path(folder) / f"{name}-{new}.npz"
            np.savez(file, **found.points._asdict())
            bodies.append(with_(body, name=new, shape=None, sampling=Regular(),
                                particles=Arrays(file=str(file))))
    shapes = COLLIDERS.get(name, {})
    return with_(scene, body=tuple(bodies), collider=tuple(
        with_(c, shape=shapes.get(c.name, c.shape)) for c in scene.collider))


def main(folder: Annotated[Path, typer.Argument(help="for scenes and particles")],
         scenes: Annotated[list[str] | None, typer.Argument(help=", ".join(BODIES))] = None,
         as_released: Annotated[bool, typer.Option(
             help="vertices are particles, of the volume dx^3/per_cell")] = True):
    """Write scenes of HOT at the printed size with the bodies of the release, and particles."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in scenes or BODIES:
        if reason := absent(name):
            raise typer.BadParameter(f"{name}: {reason}")
        scene = real_scene(name, sized(f"hot_{name}", "paper"), folder, as_released)
        file = folder / f"hot_{name}.toml"
        file.write_text(f"# {bodies_text(name)}\n{dumps(with_local_files(scene))}",
                        encoding="utf-8")
        typer.echo(f"wrote {file}")


def with_local_files(scene):
    """Return a scene whose files of particles lie in its own folder."""
    return with_(scene, body=tuple(
        body if body.particles is None
        else with_(body, particles=Arrays(file=Path(body.particles.file).name))
        for body in scene.body))


if __name__ == "__main__":
    typer.run(main)
