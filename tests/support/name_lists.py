"""Data of the rules in `check_names`: folders, banned words with advice, shared class names."""

PACKAGES = ("mpm_ref", "validation", "figures", "benchmarks", "examples")
UNIQUE = ("mpm_ref", "validation")          # class names are unique across these

# Class names that several modules share on purpose, each with the reason.
_KERNELS = "the record of a scene file, and in `core` that of the kernels it is built into"
_BUILT = "the record of a scene file, and the object of a run that it is built into"
SHARED_CLASS_NAMES: dict[str, str] = dict.fromkeys(
    ("HalfSpace", "Sphere", "Cylinder", "Capsule", "Torus", "Wedge", "Steady", "Keyframes", "Ramps",
     "Oscillation", "Motion", "Collider", "Box"), _KERNELS) | dict.fromkeys(
    ("Body", "BodyContact", "Scheme", "Limits"), _BUILT) | {
    "Material": "the record of a scene file, and in `materials` the law and flow it is built into"}

# Not even as one of the words of a name (`kept_bodies`, `HeldRun`; the plural counts as well).
BANNED_WORDS = {
    "told": "name what is passed on: summary, message, parameters",
    "said": "name the text: message, expected",
    "seen": "name what was sampled: samples, training range",
    "kept": "name the store: cache, or what it holds",
    "begun": "name the state or the act: initial, warm, resume",
    "made": "name the product or its origin: provenance, result",
    "moved": "name the state: displaced, deformed, updated",
    "apart": "name the arrangement: batched, independent, separate",
    "beside": "name the relation: reference, comparison, pair",
    "known": "name the set: names, allowed, registered",
    "found": "name the result: matches, indices, violations",
    "way": "name the choice: method, options",
    "sight": "name the quantity: view, observation",
    "course": "name the record: history, trajectory, run",
    "film": "name the data: frames, observations, animation",
    "spanned": "name the method: pod, linear subspace",
    "inferred": "name the result: prediction, network output",
    "placed": "name the subject: kinematics, positions",
    "met": "name the event: contact, collision, visited",
    "among": "name the set that is searched: candidates, neighbours",
    "nearby": "name the subject: baselines, neighbours",
    "weighed": "the field's word is weighted",
    "shipped": "the field's word is catalogue, or bundled",
    "elsewhere": "name what is there: other bodies, other scenes",
    "waiting": "name what is missing: required weights, pending",
}
# Not as a name by themselves; as one word of a name (`particles_at`) they are good English.
BANNED_NAMES = {
    "of": "name the object: world, law, state",
    "on": "name the object: nodes, grid, device",
    "at": "name the quantity: position, time, index",
    "own": "name the quantity that belongs to it",
    "whole": "name the set: full, all_particles, total",
    "reach": "name the length or set: support, stencil overlap",
    "held": "name the condition: fixed, constrained, tolerance",
    "drive": "name the act: train, run",
    "some": "name the subset: selection, samples",
    "here": "name the place: local, current",
    "free": "name what is unconstrained: free_nodes, rollout",
    "words": "name the text: messages, labels",
    "look": "the field's word is view",
    "faults": "the field's word is errors",
    "rough": "name the estimate: error_bound, coarse",
    "vary": "name the act or its data: overrides, sweep",
    "lever": "name the quantity: moment, lever_arm",
}
# Not as the name of a module.
BANNED_MODULES = {
    "inner": "name the subject of the file: error_bounds, inner_iterations",
}
# Not as the beginning of a docstring.
OPENINGS = {
    "What": "say what it is or does: 'Return ...', 'The stress ...'",
    "The same": "repeat the noun: a reader may not have seen the other text",
    "So many": "say the number: 'Number of ...'",
    "All that": "name the things",
    "That": "name the thing",
    "Those": "name the things",
    "These": "name the things",
    "This": "name the thing",
    "As": "say what it does, then what it is like",
    "How": "say what it does: 'Return the number ...', 'Options of ...'",
    "Where": "name the place or the condition after the verb",
    "Which": "name the things: 'Return the indices ...'",
    "Whether": "begin with the verb: 'Return whether ...'",
    "Of": "begin with the subject or the verb",
    "Likewise": "repeat the sentence: a reader may not have seen the other one",
    "...": "a docstring does not continue another text",
}
