"""What weights say of their making, their `about`, in words."""


def ends(errors):
    """The first and the last of some errors."""
    return f"{errors[0]:.3g} at first, {errors[-1]:.3g} at last"


def source(about):
    """What was learned from: an environment or a scene by name, and digits of the scene's hash."""
    name = about.get("environment") or about.get("title")
    digest = (about.get("scene_sha256") or about.get("scene", ""))[:12]
    return ", ".join(filter(None, (name, digest and f"scene {digest}"))) or "an unknown scene"


def by(about):
    """The command, the version of the program, and the date."""
    said = [f"made by: {about.get('command', 'unknown')}"]
    if "commit" in about:
        said.append(f"commit {about['commit']}")
    elif "source_sha256" in about:
        said.append(f"source sha256 {about['source_sha256'][:12]}")
    return ", ".join([*said, about["date"]] if "date" in about else said)
