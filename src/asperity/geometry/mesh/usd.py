"""USD (`.usd`, `.usda`, `.usdc`, `.usdz`), read by usd-core in a separate process.

usd-core believes what a damaged file counts: it reserves memory for it, reads beyond its end, and
takes the program down with it. In a process whose memory is limited, that is one line. It also
keeps what it has read: a file that has changed since would be the old one.
"""

from __future__ import annotations

import importlib.util
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.geometry.mesh.contents import Contents

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_MEMORY, _OF_FILE = 2**31, 64
"""Memory that reading may take [bytes], and for each byte of the file."""
_SECONDS, _BYTES_A_SECOND = 60.0, 1e5
"""Time that reading may take, and for how many bytes of the file another second."""
_PROGRAM = "from asperity.geometry.mesh import usd; usd.answer()"


def read_usd(path: Path) -> Contents:
    """Return the meshes of a USD file, a part for each prim and subset, in its unit."""
    contents: Contents = _in_a_process("contents_of", path)
    return contents


def usd_layers(path: Path) -> list[Path]:
    """Return the files of USD that a file refers to, itself left out."""
    layers: list[Path] = _in_a_process("layers_of", path)
    return layers


def damaged(path: Path) -> AsperityError:
    """Return the error of a file that usd-core cannot read."""
    kind = path.suffix.lower()
    return AsperityError(f"{path}: cannot be read as a {kind} file: damaged, or of another kind")


def _in_a_process(task: str, path: Path) -> Any:
    """Return what a function of `usd_stage` returns for a file."""
    if importlib.util.find_spec("pxr") is None:
        raise AsperityError(
            f"{path}: {path.suffix} files need usd-core, which is not installed; "
            "valid: pip install 'asperity[usd]', or the mesh as glTF or OBJ"
        )
    size = path.stat().st_size
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROGRAM, task, os.fspath(path), str(_MEMORY + _OF_FILE * size)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            timeout=_SECONDS + size / _BYTES_A_SECOND, check=True,
        )  # fmt: skip
        found = pickle.loads(done.stdout)
    except (subprocess.SubprocessError, pickle.UnpicklingError, EOFError):
        raise damaged(path) from None
    if isinstance(found, AsperityError):
        raise found
    return found


def answer() -> None:
    """Write the result that the arguments of this process ask for to its output, pickled."""
    task, path, memory = sys.argv[1:]
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what usd-core prints
    from asperity.geometry.mesh import usd_stage

    found: Any
    try:
        found = getattr(usd_stage, task)(Path(path))
    except AsperityError as error:
        found = error
    with output:
        pickle.dump(found, output)
