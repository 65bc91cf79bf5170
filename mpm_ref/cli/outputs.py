"""What files a command may write: asked before its work begins."""

from pathlib import Path

HDF5, MAPS, PICTURES = (".h5", ".hdf5"), (".npz",), (".png", ".pdf", ".svg")
FILES = (*HDF5, *MAPS, *PICTURES, ".toml", ".json")


def require_ending(out, endings):
    """Raise ValueError unless the name of a file to write ends in one of these."""
    if Path(out).suffix.lower() not in endings:
        raise ValueError(f"--out {out}: expected a name that ends in {' or '.join(endings)}")


def require_folder_name(out):
    """Raise ValueError where the name of a folder to write into is that of a file, unless there is
    such a folder.
    """
    ending = Path(out).suffix.lower()
    if ending in FILES and not Path(out).exists():
        raise ValueError(f"--out {out}: expected the name of a folder, but files' names end in "
                         f"{ending}; leave the ending out")


def require_free(out, overwrite):
    """Raise ValueError where a file stands that is not to be replaced."""
    if Path(out).exists() and not overwrite:
        raise ValueError(f"{out} exists: add --overwrite to replace it, or name another file")
