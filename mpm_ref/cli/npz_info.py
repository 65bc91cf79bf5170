"""`mpm-ref info` of an npz file: which of the package's it is."""

from pathlib import Path

from ..reduced.nsf import networks
from ..rom import modes_file
from ..sealed import MAGIC, opened
from . import graph_info, law_info, rom_info

SHOWN = 4           # names of arrays that a sentence shows


def is_npz(name):
    """Whether a name is that of a file that begins as npz files do."""
    if not Path(name).is_file():
        return False
    with open(name, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def of_npz(name):
    """(facts, lines) of a map, of stress fields, of laws, of their layers or of a graph network.

    Raises ValueError for a file that is damaged or none of these.
    """
    path = Path(name)
    arrays = opened(path)
    if modes_file.is_one(arrays) or networks.is_one(arrays) or "xhat" in arrays:
        facts = rom_info.of_map(path)
        return facts, rom_info.map_lines(facts)
    if graph_info.is_one(arrays):
        facts = graph_info.of_graph_network(path)
        return facts, graph_info.lines(facts)
    if law_info.is_one(arrays):
        facts = law_info.of_layers(path, arrays) if law_info.is_exported(arrays) else (
            law_info.of_laws(path))
        return facts, law_info.lines(facts)
    if epochs := law_info.epochs_of(arrays):
        raise ValueError(f"{path} holds the laws of several epochs, {', '.join(epochs)}, of a "
                         "training of the validation suite; expected those of one, as `mpm-ref law "
                         "train` writes them")
    names = sorted(arrays)
    more = ", .." if len(names) > SHOWN else ""
    raise ValueError(f"{path} holds no map, no laws and no graph network: it has "
                     f"{', '.join(names[:SHOWN])}{more}; name a file of `mpm-ref rom train`, "
                     "`mpm-ref law train` or `mpm-ref law export`")
