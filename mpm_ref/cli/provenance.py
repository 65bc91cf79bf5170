"""Describe the provenance of weights, their `about`, as text."""


def ends(errors, horizons=()):
    """Return the first and last error as text, and the horizons [steps] to which they refer.

    Errors of different horizons do not compare.
    """
    first, last = f"{errors[0]:.3g} at first", f"{errors[-1]:.3g} at last"
    if not horizons:
        return f"{first}, {last}"
    return (f"{first}, over up to {horizons[0]:.0f} steps from a restart; {last}, over up to "
            f"{horizons[1]:.0f}")


def source(about):
    """Return the source of the training data: environment or scene, and digits of its hash."""
    name = about.get("environment") or about.get("title")
    digest = (about.get("scene_sha256") or about.get("scene", ""))[:12]
    return ", ".join(filter(None, (name, digest and f"scene {digest}"))) or "an unknown scene"


def by(about):
    """Return the command, the version of the program and the date."""
    said = [f"made by: {about.get('command', 'unknown')}"]
    if "commit" in about:
        said.append(f"commit {about['commit']}")
    elif "source_sha256" in about:
        said.append(f"source sha256 {about['source_sha256'][:12]}")
    return ", ".join([*said, about["date"]] if "date" in about else said)
