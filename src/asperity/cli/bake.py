"""`asperity bake`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, in_si, with_options
from asperity.cli.result import print_result


@command
@dataclass
class BakeCommand:
    """Turn a scan into a haptic object: a low-resolution mesh and a texture of heights on it.

    Writes object.obj, heights.tiff, a scene (scene.xml, scene.toml), bake.json with the error
    against the scan, and a picture. `asperity run DIR` then slides a probe over the object.
    """

    source: Annotated[Positional[Path], arg(metavar="MESH")]
    """A mesh (.obj, .glb, .gltf, .ply, .stl), points of one side (.ply, .xyz), or a height map."""
    faces: int = 500
    """Triangles of the low-resolution mesh, 4 or more."""
    size: int = 1024
    """Texels along each side of the texture, 32 to 8192."""
    unit: str | None = None
    """Length unit of the file: m, cm, mm, in, ... Default: guessed from the size, and printed."""
    up: str | None = None
    """Axis of the mesh that points upwards: x, y or z. Default: z; for glTF, y."""
    base: Path | None = None
    """A low-resolution mesh to bake onto, instead of simplifying the scan."""
    pixel_um: Annotated[float | None, Range(1e-3, 1e5, "um")] = None
    """Sample spacing of a height map whose file does not give it."""
    relief_mm: Annotated[float | None, Range(1e-6, 100.0, "mm")] = None
    """Peak-to-valley height of a height map whose file gives no vertical scale."""
    kind: str = "height"
    """What a height map holds: height, or normal (also normal-opengl, normal-directx)."""
    colour: str | None = None
    """What the colours of a height map mean: luminance, red, green, blue, packed-rgb, terrain-rgb,
    ... Default: refuse colours."""
    nodata: Annotated[float | None, Range(-1e39, 1e39)] = None
    """Value of a height map that stands for a missing one."""
    picture: bool = True
    """Draw picture.png."""
    out: Path = Path("out/bake")
    """Folder for the result."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Bake, and print the error against the scan."""
        from asperity.baking.bake import bake
        from asperity.cli.progress import progress_bars

        options = in_si(self)
        with progress_bars() as bars:
            task = bars.add_task(self.source.name, total=100)

            def show(stage: str, share: float) -> None:
                label = f"{self.source.name}  {stage}"
                bars.update(task, completed=round(100 * share), description=label)

            baked = with_options(
                bake, self, pixel_size=options.pixel, height_range=options.relief,
                on_progress=show,
            )  # fmt: skip
        report = baked.report
        columns, rows = report["texture_size"]
        error = report["error_um"]
        line = (
            f"{self.out}: {report['full_faces']:,} triangles reduced to {report['faces']:,} and "
            f"{columns} x {rows} heights in {report['seconds']:.1f} s; error {error['rms']:.3g} "
            f"um rms, at most {error['max']:.4g} um; coverage {100 * report['coverage']:.4g} %"
        )
        print_result([line, *(f"  {note}" for note in report["notes"])], report)
