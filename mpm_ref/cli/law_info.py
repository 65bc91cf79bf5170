"""`mpm-ref info` of learned laws, their exported layers, graph networks and law studies, and
`mpm-ref law studies`.
"""

import json
from dataclasses import asdict
from itertools import count, takewhile

import numpy as np

from ..materials.learned import spline, weights
from ..materials.learned.weights import PARTS, dim_of
from ..nclaw import export
from ..nclaw.gnn import weights as gnn_weights
from ..nclaw.study.study import SYS_ID, load
from ..scene.toml import read_tables
from ..store.text import counted
from ..store.weights_file import read_provenance, require_format
from . import provenance
from .catalogue import bundled_scenes, bundled_studies
from .errors import exit_on_errors
from .options import OF_ERRORS, Json, horizons, training_error_text
from .study_kinds import is_law_study
from .terminal import print_titles

LAYERS = "mpm_ref law"          # what the format of layers begins with
AFTER = ".elastic_kind"         # what follows the epoch in such a file
OF_MARKS = "squared distance of marks in images [px^2]"
WITH_VELOCITIES = ", with the term of velocities,"
SPLINES = {kind.__name__ for kind in spline.READINGS}


def has_laws(arrays):
    """Return whether arrays are those of laws or of their exported layers, of any format."""
    return "elastic_kind" in arrays


def epochs_of(arrays):
    """The epochs of laws that a file has of several, in words and in order; none of other files."""
    return sorted((name.removesuffix(AFTER) for name in arrays if name.endswith(AFTER)), key=int)


def is_exported(arrays):
    """Return whether arrays are those of exported layers."""
    return str(arrays.get("format")).startswith(LAYERS)


def laws_facts(path):
    """Return the content and provenance of a file of laws. Raises ValueError for another file."""
    laws = weights.load(path)
    found = {part: law_facts(type(law.kind).__name__, [a for layer in law.layers for a in layer],
                           law.kind._asdict())
             for part, law in zip(weights.PARTS, laws[:2], strict=True)}
    return {"laws": str(path), "dim": dim_of(laws), **found, **training_facts(laws.about)}


def read_json_layers(path):
    """The arrays of layers as JSON, by the names that they have in an npz file; None for any other
    file. Raises ValueError for lists that are no arrays.
    """
    if path.suffix.lower() != ".json" or not path.is_file():
        return None
    try:
        found = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or not is_exported(found):
        return None
    try:
        return export.flatten_tables(found)
    except ValueError as error:
        raise ValueError(f"{path} holds no layers of laws: {error}; export them again") from None


def layers_facts(path, arrays):
    """Return the content and provenance of exported layers. Raises ValueError for other arrays."""
    require_format(path, arrays, export.FORMAT, "layers of laws")
    needed = {"dim", "check_F", *(f"{part}_kind" for part in weights.PARTS)}
    if missing := sorted(needed - set(arrays)):
        raise ValueError(f"{path} holds no layers of laws: it lacks {', '.join(missing)}; export "
                         "them again")
    return {"layers": str(path), "dim": int(arrays["dim"]), "questions": len(arrays["check_F"]),
            **{part: facts_from_arrays(part, arrays) for part in weights.PARTS},
            **training_facts(read_provenance(path, arrays))}


def facts_from_arrays(part, arrays):
    """Return the description of a law from the arrays of its exported layers."""
    own = {name.removeprefix(f"{part}_"): a for name, a in arrays.items() if name.startswith(part)}
    depth = len(list(takewhile(lambda k: f"W{k}" in own, count())))
    layers = [own[f"{name}{k}"] for k in range(depth) for name in "Wb"]
    scalars = {name: float(a) for name, a in own.items() if a.ndim == 0 and a.dtype.kind in "fiu"}
    return law_facts(str(own["kind"]), layers or [own[name] for name in own if name == "tables"],
                   scalars)


def law_facts(kind, learned, constants):
    """Return the description of a law as plain values.

    learned: W and b of its layers in turn, or tables of splines. The number of weights includes
    biases unless all are zero: such a law has none.
    """
    widths = [] if kind in SPLINES else [len(W) for W in learned[::2]] + [
        len(b) for b in learned[-1:]]
    return {"kind": kind, "widths": widths, "constants": constants,
            "weights": sum(a.size for a in learned if a.ndim > 1 or a.any())}


def training_facts(about):
    """Return the training data in a provenance, None for missing entries."""
    recipe, errors = about.get("recipe", {}), about.get("errors")
    return {"method": about.get("method"), "dt": about.get("dt"), "seen": about.get("seen"),
            "epochs": len(errors) if errors else recipe.get("epochs"), "errors": errors,
            "about": about}


def laws_lines(facts):
    """Return facts of laws as lines of text."""
    file, what = (facts["laws"], "learned laws") if "laws" in facts else (
        facts["layers"], f"layers of learned laws, {counted(facts['questions'], 'question')} with "
                         "answers")
    method = f', method "{facts["method"]}"' if facts["method"] else ""
    dt = f", for steps of {facts['dt']:g} s" if facts["dt"] else ""
    yield f"{file}: {what}, {facts['dim']}D{method}{dt}"
    for part in weights.PARTS:
        yield f"{part}: {part_line(facts[part])}"
    if facts["epochs"]:
        yield f"trained on {provenance.source(facts['about'])}, {training_line(facts)}"
    if facts["seen"]:
        yield training_range_line(facts["seen"])
    yield provenance.by(facts["about"])


def part_line(part):
    """Return a law as text."""
    said = [part["kind"]]
    if part["kind"] in SPLINES:
        said.append(f"splines of {counted(part['weights'], 'number')}")
    elif part["widths"]:
        said += [f"layers {'-'.join(map(str, part['widths']))}", f"{part['weights']} weights"]
    return ", ".join(said + [f"{name} = {value:g}" for name, value in part["constants"].items()])


def training_line(facts):
    """Return the length and the errors of a training as text."""
    epochs = counted(facts["epochs"], "epoch")
    if not facts["errors"]:
        return epochs
    about, method = facts["about"], facts["method"]
    filmed = "camera" in about
    more = WITH_VELOCITIES if weights.errors_include_velocities(about) else ""
    over = () if filmed else horizons(method, about.get("recipe", {}), facts["epochs"])
    return (f"{epochs}: {OF_MARKS if filmed else training_error_text(method)}{more} "
            f"{provenance.ends(facts['errors'], over)}")


def training_range_line(bounds):
    """Return the strains of a training as text (see `learned.strain_range`)."""
    low, high = (np.array(bounds[end]) for end in ("low", "high"))
    return (f"met in training: stretches {low[:-1].min():.3g} .. {high[:-1].max():.3g}, "
            f"J {low[-1]:.3g} .. {high[-1]:.3g}")


def is_graph_network(arrays):
    """Return whether arrays are those of a graph network, of any format."""
    return str(arrays.get("format")).startswith(gnn_weights.FORMAT.split()[0])


def graph_network_facts(path):
    """Return the content and provenance of a graph network. Raises ValueError for another file."""
    network, reading, about = gnn_weights.load(path)
    return {
        "graph_network": str(path), "dim": len(reading.scales.v_mean),
        "width": network.points.layers[0][0].shape[1], "blocks": len(network.blocks),
        "weights": sum(a.size for _, one in gnn_weights.named(network)
                       for a in (*(a for layer in one.layers for a in layer), *one.norm)),
        "radius": reading.radius, "dt": reading.dt,
        "runs": about.get("runs"), "steps": about.get("recipe", about).get("steps"),
        "errors": about.get("errors"), "picked": about.get("picked"), "about": about,
    }


def graph_network_lines(facts):
    """Return facts of a graph network as lines of text."""
    about = facts["about"]
    yield (f"{facts['graph_network']}: a graph network, {facts['dim']}D, {facts['width']} wide, "
           f"{counted(facts['blocks'], 'block')}, {facts['weights']} weights and biases")
    yield f"frames {facts['dt']:g} s apart, neighbours within {facts['radius']:g} m"
    if facts["runs"] and facts["steps"]:
        yield (f"trained on {counted(facts['runs'], 'run')} of {provenance.source(about)}: "
               f"{counted(facts['steps'], 'step')} of Adam")
    if facts["errors"] and facts["picked"] is not None:
        first, kept = (error_text(facts["errors"][k]) for k in (0, facts["picked"]))
        yield f"mean squared error of a free run [m^2]: {first} at first, {kept} of what is kept"
    yield provenance.by(about)


def error_text(error):
    """Return the error of a rollout as text; None is that of one that broke down."""
    return "inf" if error is None else f"{error:.3g}"


def studies(json: Json = False):
    """List the bundled law studies."""
    with exit_on_errors():
        print_titles({name: read_tables(path).get("title", "")
                      for name, path in bundled_studies().items() if is_law_study(path)}, json)


def law_study_facts(path):
    """Return scene, method, laws and recipe of a study. Raises SceneError."""
    study = load(path, bundled_scenes())
    tables, scene, problem = study.tables, study.scene, study.problem()
    records = tables.records or (problem.bodies[0].law, problem.bodies[0].flow)
    return {
        "law_study": str(study.path), "title": tables.title, "scene": tables.scene,
        "dim": problem.dim, "points": len(problem.bodies[0].id), "dx": scene.dx, "dt": scene.dt,
        "steps": scene.steps, "method": tables.method,
        "laws": {part: {"kind": type(record).__name__, "constants": record._asdict()}
                 for part, record in zip(PARTS, records, strict=True)},
        "recipe": asdict(tables.train),
        "files": {name: str(study.file(name)) for name in ("weights", "checkpoint")
                  if study.file(name)},
    }


def law_study_lines(facts):
    """Return facts of a law study as lines of text."""
    recipe, method = facts["recipe"], facts["method"]
    yield (f"{facts['law_study']}: a law study, {facts['title'] or 'untitled'}: laws of the scene "
           f'{facts["scene"]}, method "{method}"')
    yield (f"{facts['dim']}D, {counted(facts['points'], 'point')}, dx = {facts['dx']:g} m, "
           f"{counted(facts['steps'], 'step')} of {facts['dt']:g} s")
    laws = "; ".join(f"{part} {law_line(law)}" for part, law in facts["laws"].items())
    yield f"{'constants of' if method == SYS_ID else 'laws'}: {laws}"
    horizon = "" if method in OF_ERRORS else (
        f", horizon {recipe['first']} .. {recipe['last']} steps")
    yield (f"training: {counted(recipe['epochs'], 'epoch')}{horizon}, rates "
           f"{recipe['elastic_rate']:g} (elastic) and {recipe['plastic_rate']:g} (plastic), seed "
           f"{recipe['seed']}")


def law_line(law):
    """Return a law of a study as text."""
    return ", ".join([law["kind"], *(f"{name} = {value:g}" for name, value in
                                     law["constants"].items())])
