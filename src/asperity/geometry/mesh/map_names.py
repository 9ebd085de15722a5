"""Pictures that belong together by their file names: the maps of a material.

The words are those of ambientCG, Poly Haven, Quixel, Poliigon, Substance, Unity, Unreal and others.
"""

from __future__ import annotations

import importlib.util
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from asperity.errors import AsperityError
from asperity.geometry.mesh.materials import FELT, MapImage

_BY_NAME = {
    "displacement": ("displacement", "disp", "displace", "dispmap", "displacementmap", "height",
                     "heightmap", "heightfield", "parallax", "depth", "dsp"),
    "normal": ("normal", "normals", "normalgl", "normaldx", "normalogl", "nrm", "nor", "norm",
               "normalmap", "nrml", "nml", "ddn", "ddna"),
    "bump": ("bump", "bumpmap"),
    "colour": ("color", "colour", "basecolor", "basecolour", "albedo", "diffuse", "diff", "col"),
    "roughness": ("roughness", "rough", "rgh"),
    "other": ("ao", "ambientocclusion", "occlusion", "occ", "arm", "orm", "rma", "mra", "mrao",
              "metallic", "metalness", "opacity", "alpha", "mask", "cavity", "gloss", "glossiness",
              "smoothness",
              "specular", "spec", "reflection", "translucency", "transmission", "emission",
              "emissive", "curvature", "thickness", "preview", "thumb", "thumbnail", "render"),
}  # fmt: skip
"""Words in names of files that stand for kinds of maps; "other" are of no use here."""
_GLUED = {
    "displacement": ("displacement", "heightmap", "height"), "normal": ("normalmap", "normal"),
    "colour": ("basecolor", "albedo", "diffuse"), "roughness": ("roughness",),
}  # fmt: skip
"""Words that are long enough to be known at the end of another."""
_SHORT = {
    "n": "normal", "nm": "normal", "h": "displacement", "d": "colour", "bc": "colour",
    "r": "roughness",
}  # fmt: skip
"""Last letters of names that begin with T_, as Unreal's pictures do, or that stand in a folder."""
_WORKFLOWS = ("METALNESS", "SPECULAR")
"""Last words of names that state which set of maps it is of, not what it shows."""
_SUFFIXES = (".tif", ".tiff", ".png", ".exr", ".tga", ".bmp", ".webp", ".dds", ".jpg", ".jpeg")
"""Of pictures, those that keep more of the heights first."""
_SIZE = re.compile(r"(\d+)k|jpe?g|png|exr|tiff?")
"""Words about the size and the kind of a picture."""
_DIRECTX = re.compile(r"(?<![a-z])(?:dx|directx)(?![a-z])|(?<=normal)(?:dx|directx)(?![a-z])")
_LARGEST = 8
"""Thousands of pixels along a side: larger pictures are taken if there are no others."""
_DEEPEST, _MOST_FILES = 3, 20_000


class _Named(NamedTuple):
    """What a file's name states: its material's words, the kind of map, thousands of pixels."""

    path: Path
    material: tuple[str, ...]
    kind: str
    size: int

    def rank(self) -> tuple[bool, bool, int, int, Path]:
        """Return what to sort by: those that are better come first."""
        suffix = self.path.suffix.lower()
        unread = suffix == ".exr" and importlib.util.find_spec("OpenEXR") is None
        # Green up is what OpenGL and most programs write.
        down = _DIRECTX.search(self.path.stem.lower()) is not None
        size = self.size if self.size <= _LARGEST else -self.size
        return unread, down, _SUFFIXES.index(suffix), -size, self.path


def maps_by_name(
    files: Iterable[Path], stem: str | None = None, *, short: bool = False
) -> dict[str, MapImage]:
    """Return the pictures among files whose names say what they are, by kind.

    Of several of a kind the one that keeps most of the heights is taken, green up before green
    down, then the largest; others than heights rather of the same material.

    Parameters
    ----------
    files : iterable of Path
    stem : str, optional
        How names have to begin, in any case: those of pictures that belong to a mesh of this name.
    short : bool
        Whether a last letter counts, as in `brick_N.png`, also without T_ before.
    """
    found = list(_named(files, stem, short))
    felt = next((kind for kind in FELT if any(one.kind == kind for one in found)), None)
    of_felt = [one for one in found if one.kind == felt]
    material = min(of_felt, key=_Named.rank).material if of_felt else ()
    out = {}
    for kind in dict.fromkeys(one.kind for one in found):
        best = min(
            (one for one in found if one.kind == kind),
            key=lambda one: (one.material != material, *one.rank()),
        )
        out[kind] = MapImage(best.path, best.path.name)
    return out


def maps_in_folder(folder: Path, notes: list[str]) -> dict[str, MapImage]:
    """Return the maps in a folder, or else below it, by their names; at least one that is felt.

    Parameters
    ----------
    folder : Path
    notes : list of str
        Gets notes on which was chosen.

    Raises
    ------
    AsperityError
        No map that can be felt, or maps of several materials; one line.
    """
    for files in (list(folder.iterdir()), _below(folder)):
        maps = maps_by_name(files, short=True)
        felt = next((kind for kind in FELT if kind in maps), None)
        if felt is not None:
            _check_one(folder, [o for o in _named(files, None, True) if o.kind == felt], notes)
            return maps
    found = ", ".join(sorted(p.name for p in folder.iterdir())[:5])
    raise AsperityError(
        f"{folder}: no file in this folder is named as a displacement or normal map "
        f"({found or 'it is empty'}); valid: names such as brick_Displacement.png"
    )


def _check_one(folder: Path, found: list[_Named], notes: list[str]) -> None:
    """Raise `AsperityError` for maps of several materials; note which of several of one is used."""
    materials = sorted({" ".join(one.material) for one in found})
    if len(materials) > 1:
        raise AsperityError(
            f"{folder}: it holds {found[0].kind} maps of {len(materials)} materials "
            f"({', '.join(materials)[:120]}); valid: a folder of one, or one of the files"
        )
    best, *rest = sorted(found, key=_Named.rank)
    down = best.kind == "normal" and not best.rank()[1]
    others = [one.path.name for one in rest if not (down and one.rank()[1])]
    if others:
        notes.append(
            f"of its {len(others) + 1} {best.kind} maps {best.path.name} is used, "
            f"not {', '.join(others)[:120]}"
        )


def _below(folder: Path) -> list[Path]:
    """Return the files in the folders of a folder."""
    out: list[Path] = []
    for root, folders, files in os.walk(folder):
        depth = len(Path(root).relative_to(folder).parts)
        folders[:] = sorted(
            name for name in folders
            if depth < _DEEPEST and not name.startswith((".", "__MACOSX"))
        )  # fmt: skip
        out += [Path(root) / name for name in files]
        if len(out) > _MOST_FILES:
            break
    return out


def _named(files: Iterable[Path], stem: str | None, short: bool) -> Iterator[_Named]:
    """Yield the pictures among files whose names say what they are."""
    for path in sorted(files):
        hidden = path.name.startswith(".")  # as macOS has beside each file on foreign disks
        if hidden or path.suffix.lower() not in _SUFFIXES or not path.is_file():
            continue
        begins = path.stem.lower().removeprefix("t_")
        if stem is not None and not begins.startswith(stem.lower().removeprefix("t_")):
            continue
        named = _parsed(path, short)
        if named is not None and named.kind != "other":
            yield named


def _parsed(path: Path, short: bool) -> _Named | None:
    """Return what the last telling word in a name states, None without."""
    words = [word for word in re.split(r"[\W_]+", path.stem) if word]
    sizes = [_SIZE.fullmatch(word.lower()) for word in words]
    size = max((int(found.group(1) or 0) for found in sizes if found), default=0)
    if any(sizes[:-1]) and words[-1] in _WORKFLOWS:  # Poliigon's, behind the size
        words, sizes = words[:-1], sizes[:-1]
    words = [word for word, found in zip(words, sizes, strict=True) if not found]
    lower = tuple(word.lower() for word in words)
    if lower and lower[-1] in _SHORT and (short or lower[0] == "t"):
        return _Named(path, lower[:-1], _SHORT[lower[-1]], size)
    for kind_of in (_exact, _glued):
        for place in range(len(words) - 1, -1, -1):
            found = kind_of(words[place])
            if found is not None:
                kind, rest = found
                return _Named(path, (*lower[:place], *rest), kind, size)
    return None


def _exact(word: str) -> tuple[str, tuple[str, ...]] | None:
    """Return the kind that a word, or the last telling part of it, stands for; and what is before.

    `RockNormal` has two parts; digits behind a word count nothing, as in `DISP16`.
    """
    parts = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", word).lower().split()
    for place, part in ((-1, word.lower()), *reversed(list(enumerate(parts)))):
        plain = part.rstrip("0123456789")
        for kind, names in _BY_NAME.items():
            if plain in names:
                return kind, tuple(parts[: max(place, 0)])
    return None


def _glued(word: str) -> tuple[str, tuple[str, ...]] | None:
    """Return the kind that the end of a word in small letters stands for, and what is before."""
    plain = word.lower().rstrip("0123456789")
    for kind, names in _GLUED.items():
        for name in names:
            if plain.endswith(name):
                return kind, (plain.removesuffix(name),)
    return None
