"""`mpm-ref info` of graph networks, which laws are compared with."""

from ..nclaw.gnn import weights
from ..store.words import counted
from . import made


def is_one(arrays):
    """Whether the arrays of a file are those of a graph network, of any format."""
    return str(arrays.get("format")).startswith(weights.FORMAT.split()[0])


def of_graph_network(path):
    """What a file of weights holds, and what it says of its making. Raises ValueError for a file
    that is damaged or no graph network.
    """
    network, reading, about = weights.load(path)
    return {
        "graph_network": str(path), "dim": len(reading.scales.v_mean),
        "width": network.points.layers[0][0].shape[1], "blocks": len(network.blocks),
        "weights": sum(a.size for _, one in weights.named(network)
                       for a in (*(a for layer in one.layers for a in layer), *one.norm)),
        "radius": reading.radius, "dt": reading.dt,
        "runs": about.get("runs"), "steps": about.get("recipe", about).get("steps"),
        "errors": about.get("errors"), "picked": about.get("picked"), "about": about,
    }


def lines(facts):
    """Facts of a graph network in words."""
    about = facts["about"]
    yield (f"{facts['graph_network']}: a graph network, {facts['dim']}D, {facts['width']} wide, "
           f"{counted(facts['blocks'], 'block')}, {facts['weights']} weights and biases")
    yield f"frames {facts['dt']:g} s apart, neighbours within {facts['radius']:g} m"
    if facts["runs"] and facts["steps"]:
        yield (f"trained on {counted(facts['runs'], 'run')} of {made.source(about)}: "
               f"{counted(facts['steps'], 'step')} of Adam")
    if facts["errors"] and facts["picked"] is not None:
        first, kept = (in_words(facts["errors"][k]) for k in (0, facts["picked"]))
        yield f"mean squared error of a free run [m^2]: {first} at first, {kept} of what is kept"
    yield made.by(about)


def in_words(error):
    """The error of a free run; None is that of one that broke down."""
    return "inf" if error is None else f"{error:.3g}"
