"""Surface meshes of the papers' bodies, in a folder of the user's: none is part of the repository.

The environment variable `MPM_REF_MESHES` names the folder; in it `hot` and `nclaw` hold the meshes
of the two papers, under the names that their public releases give them.
"""

import hashlib
import os
from pathlib import Path

VARIABLE = "MPM_REF_MESHES"


def mesh_file(paper, name, sha256=None):
    """Return the path of a paper's mesh, or None where no folder is named or the file is missing.

    Raises ValueError where the file has not the hash that is expected.
    """
    folder = os.environ.get(VARIABLE)
    file = Path(folder or "") / paper / name
    if not folder or not file.is_file():
        return None
    if sha256 is not None and (found := _hash(file)) != sha256:
        raise ValueError(f"{file}: another file than that of the release, its sha256 is {found}, "
                         f"expected {sha256}; take the file of the public release, or remove it to "
                         "run on stand-ins")
    return file


def _hash(file):
    with open(file, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
