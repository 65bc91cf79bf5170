"""Implement `mpm-ref info` for studies and reduced models, and `mpm-ref rom studies`."""

import msgspec
import numpy as np

from ..rom import model_file
from ..rom.fields.network import Decoder, Networks
from ..rom.fields.pod_fields import PodFields
from ..rom.fields.polynomial_manifold import Curved
from ..rom.study.record import supported_model
from ..rom.study.study_file import parse_tables
from ..rom.study.tables import CURVED, MODES, NETWORK, NSF
from ..scene.toml import read_tables
from ..store.text import counted
from .catalogue import bundled_studies
from .errors import exit_on_errors
from .options import Json, load_study
from .study_kinds import is_study
from .terminal import print_titles

TERMS = ("position", "F", "velocity")       # of the loss of a network
MEASURES = {"origin": "of the distance from the scene's origin",
            "centroid": "from the body's centroid", "displacement": "of the displacement"}


def studies(json: Json = False):
    """List the bundled studies of reduced models."""
    with exit_on_errors():
        print_titles({name: parse_tables(read_tables(path)).title for name,
                      path in bundled_studies().items()
                if is_study(path)}, json)


def of_study(name):
    """Scene, runs, parameters, map and reduced runs of a study. Raises SceneError, and ValueError
    for a scene that reduced runs do not know.
    """
    study = load_study(name)
    tables, one = study.tables, supported_model(study, study.mu[0])
    return {
        "study": str(study.path), "title": tables.title, "scene": tables.scene,
        "dim": study.base.dim, "points": len(one.X), "dx": study.base.dx, "dt": study.base.dt,
        "steps": study.base.steps, "runs": len(study.mu), "held_out": study.test,
        "parameters": ranges(study.names, study.mu),
        "keys": {one.name: one.key for one in tables.parameter},
        "map": tables.reduced_model.settings,
        "run": msgspec.to_builtins(tables.run), "study_sha256": study.digest,
        **stress_study_facts(study),
    }


def study_lines(facts):
    """Return facts of a study as lines of text."""
    map, run = facts["map"], facts["run"]
    inferred = "model" in facts
    return [
        f"{facts['study']}: a study, {facts['title'] or 'untitled'}: "
        f"{counted(facts['runs'], 'run')} of the scene {facts['scene']}, "
        f"{len(facts['held_out'])} held out",
        f"{facts['dim']}D, {facts['points']} points, dx = {facts['dx']:g} m, "
        f"{counted(facts['steps'], 'step')} of {facts['dt']:.6g} s"
        f"{stored_states(facts) if inferred else ''}",
        f"parameters: {in_ranges(facts['parameters'], facts['keys'])}",
        fields_line(facts) if inferred else
        f"map: {map['kind']}, r = {map['r']}; reduced runs: {run['quadrature']} quadrature, "
        f"{run['projection']} projection, {run['points'] or 'all'} points",
    ]


def of_map(path):
    """Return content and provenance of a file of `mpm-ref rom train`; None for missing entries.

    Raises ValueError for a file that is damaged or no map.
    """
    model = model_file.load(path)
    about, map = model.about, model.field
    runs, levels, r = model.xhat.shape
    names, loss, fit = about.get("parameters", ()), about.get("loss"), about.get("fit", {})
    return {
        "map": str(path), "kind": kind_of(map), "r": r, "dim": map.dim,
        "points": fit.get("points", points_of(map)), "runs": runs, "steps": levels - 1,
        "parameters": ranges(names, about["mu"]) if names else None,
        "errors": fit.get("errors"), "last_loss": loss[-1] if loss else None, "about": about,
        **stress_field_facts(map, levels),
    }


def map_lines(facts):
    """Return facts of a map as lines of text."""
    points = f", {counted(facts['points'], 'point')}" if facts["points"] else ""
    varied = f", {in_ranges(facts['parameters'])}" if facts["parameters"] else ""
    inferred = "model" in facts
    what = "stress fields" if inferred else "a map"
    each = counted(facts["states"], "state") if inferred else counted(facts["steps"], "step")
    runs = f"{counted(facts['runs'], 'run')} of {each}"
    lines = [f"{facts['map']}: {what}, {facts['kind']}, r = {facts['r']}, {facts['dim']}D{points}"
             f"{source(facts['about'])}", f"made of {runs}{varied}"]
    if inferred:
        lines += training_lines(facts["about"])
    if facts["errors"]:
        off = ", ".join(f"{100.0 * facts['errors'][name]:.3g} % {words}"
                        for name, words in MEASURES.items() if name in facts["errors"])
        lines.append(f"off these runs, at its own latent coordinates, by {off}")
    if facts["last_loss"]:
        total, *terms = facts["last_loss"]
        named = ", ".join(f"{name} {term:.3g}" for name, term in zip(TERMS, terms, strict=True))
        lines.append(f"last loss kept: {total:.3g} ({named})")
    lines.append(f"made by: {facts['about'].get('command', 'unknown')}")
    return lines


def source(about):
    """The study and scene that a map says it is of, in words."""
    names = {"study": about.get("name") or about.get("study", "")[:12], "scene": about.get("scene")}
    return "".join(f", {what} {name}" for what, name in names.items() if name)


def in_ranges(parameters, keys=None):
    """Return {name: [least, largest]} as text, with the paths of the parameters in the scene."""
    return ", ".join(f"{name} = {low:g} .. {high:g}" + (f" ({keys[name]})" if keys else "")
                     for name, (low, high) in parameters.items())


def kind_of(field):
    """Return the kind of a field as study files name it."""
    if isinstance(field, Decoder | Networks):
        return NETWORK
    return CURVED if isinstance(field, Curved) else MODES


def points_of(field):
    """Return the number of points of modes; None for a network, which has none."""
    if isinstance(field, Decoder | Networks):
        return None
    return len((field.modes if isinstance(field, Curved) else field).X)


def ranges(names, mu):
    """Return {name: [least, largest]} of parameters mu (runs, parameters)."""
    return {name: [min(values), max(values)] for name, values in
            zip(names, zip(*map(tuple, mu), strict=True), strict=True)}


OF = {"modes": "the displacement", "tau": "the stress", "C": "the affine field"}


def stress_study_facts(study):
    """Further facts of a study; none of another model."""
    if study.tables.model != NSF:
        return {}
    return {"model": NSF, "every": study.base.every}


def stress_field_facts(fields, levels):
    """Further facts of fields from the states of each run, whose steps they do not know; none of a
    map of another model.
    """
    inferred = isinstance(fields, Networks | PodFields)
    return {"model": NSF, "states": levels, "steps": None} if inferred else {}


def stored_states(facts):
    """Return the share of states of a run that a study stores, as text."""
    every = facts["every"]
    return f", one in {every} kept" if every > 1 else ""


def fields_line(facts):
    """Return fields and reduced runs of a study as text."""
    map, run = facts["map"], facts["run"]
    longer = f", steps {run['dt_factor']:g} times as long" if run["dt_factor"] != 1.0 else ""
    tolerance, single = run.get("inversion_tolerance"), run.get("precision") == "single"
    stop = f" to {tolerance:g}" if tolerance else ""
    return (f"stress fields: {map['kind']}, r = {map['r']}, {sizes_text(map)}; reduced runs: "
            f"{run['inversion']} inversion{stop}, {samples_text(run)}{longer}"
            f"{', single precision' if single else ''}")


def samples_text(run):
    """Return the number and kind of the sample points as text."""
    if run.get("cells"):
        return f"points of {run['cells']} cells at most, with weights"
    return (f"{run['points'] or 'all'} points"
            f"{' at most, with weights' if run['weighted'] else ''}")


def training_lines(about):
    """Yield the training data of fields as lines of text.

    Trainings of experiments have no study, and store the losses of several epochs.
    """
    if "map" in about:
        yield sizes_text(about["map"])
    if "losses" in about:
        losses = zip(OF.values(), about["losses"].values(), strict=False)
        yield "last losses: " + ", ".join(f"{np.ravel(loss)[-1]:.3g} of {what}"
                                          for what, loss in losses)


def sizes_text(settings):
    """Return the numbers of modes or widths of networks, and whether the stress sees mu."""
    sees = "sees" if settings["stress_sees_parameters"] else "does not see"
    sees = f"the stress {sees} the parameters"
    if settings["kind"] == NETWORK:
        octaves = settings["octaves"]
        waves = f", octaves of sines and cosines: {octaves}" if octaves else ""
        return f"factors of width {', '.join(str(one) for one in settings['beta'])}{waves}; {sees}"
    modes = ", ".join(f"{settings[name]} of {what}" for name, what in OF.items() if settings[name])
    return f"modes: {modes}; {sees}"
