"""`python -m validation.bounds NAME...`: tell weights of NCLaw's experiments that are older than
the bounds of strains which strains their training met, so that runs can say where they leave them.

It needs no PyTorch: the last epoch's segments run again. What was learned stays to the bit.
"""

from pathlib import Path
from typing import Annotated

import typer

from mpm_ref.materials.learned import weights

from .nclaw.environments import environment
from .nclaw.met import bounds
from .nclaw.nets import FOLDER, Net, nets, trained
from .provenance import commit

ROOT = Path(__file__).parents[1]


def told(name):
    """The `weights.Laws` of a net by name, with `seen` and `dt` in what is known of them. Raises
    BadParameter for weights that are not there, are damaged, or have bounds already.
    """
    net = nets()[name]
    try:
        laws = trained(name)
    except ValueError as fault:
        raise typer.BadParameter(str(fault)) from None
    if "seen" in laws.about:
        raise typer.BadParameter(f"{name} knows its bounds already: name another")
    return laws._replace(about={
        **laws.about, "seen": bounds(net, laws), "dt": environment(net.environment).dt,
        "seen_by": f"python -m validation.bounds {name}, {commit(ROOT)}"})


def main(names: Annotated[list[str], typer.Argument(help="of nets with laws")]):
    """Write the files of those weights again, with the bounds."""
    laws = [name for name, net in nets().items() if isinstance(net, Net)]
    there = [name for name in laws if (FOLDER / f"{name}.npz").exists()]
    for name in names:
        if name not in laws:
            raise typer.BadParameter(f"{name!r}: expected one of {', '.join(there)}")
    for name, own in [(name, told(name)) for name in names]:
        weights.save(FOLDER / f"{name}.npz", own)


if __name__ == "__main__":
    typer.run(main)
