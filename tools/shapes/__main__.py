"""Write the shipped meshes: `python -m tools.shapes`, from the root of the repository."""

from __future__ import annotations

from asperity.geometry.shapes.shape import shipped_file, write_shape
from tools.shapes.cad_part import cad_part
from tools.shapes.file_tool import file_tool
from tools.shapes.hammer import hammer

MAKERS = {maker.__name__: maker for maker in (hammer, file_tool, cad_part)}
"""Generators of the shipped meshes, by the name of their file."""


def main() -> None:
    """Generate every mesh and write it to where the package reads it from."""
    for name, maker in MAKERS.items():
        path = shipped_file(name)
        shape = maker()
        write_shape(path, shape)
        print(f"{path}: {len(shape.faces)} triangles, {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
