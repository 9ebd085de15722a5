"""`asperity bake`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.ranges import Between, check_ranges


@dataclass
class BakeCommand:
    """Make a haptic object of a scan: few triangles, and a texture of heights with all the rest.

    Writes object.obj, heights.tiff, a scene (scene.xml, scene.toml), bake.json with the error
    against the scan, and a picture. `asperity run DIR` slides a probe over it.
    """

    source: Annotated[Positional[Path], arg(metavar="MESH")]
    """A mesh (.obj, .glb, .gltf, .ply, .stl), points of one side (.ply, .xyz), or a height map."""
    faces: int = 500
    """Triangles of the simple mesh, 4 or more."""
    size: int = 1024
    """Texels along each side of the texture, 32 to 8192."""
    unit: str | None = None
    """Of the file: m, cm, mm, in, ... Default: guessed, and said."""
    up: str | None = None
    """x, y or z: which of the mesh's axes points upwards. Default: z; of glTF, y."""
    base: Path | None = None
    """A low-resolution mesh to bake onto, instead of simplifying."""
    pixel_um: Annotated[float | None, Between(1e-3, 1e5)] = None
    """Distance between samples of a height map that does not hold it [um]."""
    relief_mm: Annotated[float | None, Between(1e-6, 100.0)] = None
    """Lowest to highest of a height map that carries no scale [mm]."""
    picture: bool = True
    """Draw picture.png."""
    out: Path = Path("out/bake")
    """Folder for the result."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Bake, and say how near it comes."""
        check_ranges(self)
        from asperity.baking.bake import bake
        from asperity.cli.progress import progress_bars

        with progress_bars() as bars:
            task = bars.add_task(self.source.name, total=100)

            def show(stage: str, share: float) -> None:
                told = f"{self.source.name}  {stage}"
                bars.update(task, completed=round(100 * share), description=told)

            baked = bake(
                self.source,
                self.out,
                faces=self.faces,
                size=self.size,
                unit=self.unit,
                up=self.up,
                base=self.base,
                pixel_size=None if self.pixel_um is None else self.pixel_um * 1e-6,
                height_range=None if self.relief_mm is None else self.relief_mm * 1e-3,
                picture=self.picture,
                overwrite=self.overwrite,
                on_progress=show,
            )
        report = baked.report
        columns, rows = report["texture_size"]
        error = report["error_um"]
        print(
            f"{self.out}: {report['full_faces']:,} triangles to {report['faces']:,} and "
            f"{columns} x {rows} heights in {report['seconds']:.1f} s; off by {error['rms']:.3g} "
            f"um (rms), {error['max']:.4g} um at most; {100 * report['coverage']:.4g} % found"
        )
        for note in report["notes"]:
            print(f"  {note}")
