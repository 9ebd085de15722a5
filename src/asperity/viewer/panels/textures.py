"""Textures and meshes of the bodies: built-in ones, or uploaded files with their scale."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from asperity.drawing.pages import render
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import UNITS
from asperity.scene.mesh import MESHES
from asperity.scene.scene import Scene
from asperity.texture.patterns.patterns import PATTERNS
from asperity.viewer.changes import (
    AS_IT_IS,
    PIXEL,
    RELIEF,
    SMOOTH,
    SURFACES,
    bodies_of,
    texture_of,
    with_meshes,
    with_texture,
)
from asperity.viewer.drawables.colours import css_gradient
from asperity.viewer.notify import attempt, from_browser
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.panels.scene_view import SceneView
from asperity.viewer.server.uploads import IMAGE_SUFFIXES, MESH_SUFFIXES, Uploads
from asperity.viewer.servo_client import ServoClient

FILE = "the file below"
STATED = "as stated, else mm"
_PLAIN_PIXEL, _PLAIN_RELIEF = 5e-5, 2e-4
"""Initial pixel size and relief of an uploaded image [m]; project defaults."""


class TexturesPanel(Panel):
    """Textures and meshes of the bodies.

    Parameters
    ----------
    view : SceneView, optional
        Which colours by height.
    """

    title = "Surfaces"

    def __init__(self, view: SceneView | None = None) -> None:
        self._view = view
        self._uploads = Uploads()
        self._image: dict[str, Any] | None = None
        self._meshes: dict[str, dict[str, Any]] = {}
        self._generation = -1

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the controls."""
        self._servo = servo
        gui = server.gui
        self._by_height = gui.add_checkbox(
            "Colour by height", False, hint="Near the contact, where the relief is drawn finely"
        )
        self._by_height.on_update(self._coloured)
        self._legend = gui.add_html("", visible=False)
        bodies = bodies_of(servo.config.scene)
        with gui.add_folder("Texture"):
            self._body = gui.add_dropdown("body", bodies)
            self._kind = gui.add_dropdown("texture", [AS_IT_IS, SMOOTH, *SURFACES, *PATTERNS, FILE],
                hint="Surfaces and patterns made by code, or your own file",
            )  # fmt: skip
            self._relief = gui.add_number(
                "height [mm]", 0.2, min=1e3 * RELIEF[0], max=1e3 * RELIEF[1], step=0.001,
                hint="From the lowest to the highest point",
            )  # fmt: skip
            self._pixel = gui.add_number(
                "pixel size [um]", 50.0, min=1e6 * PIXEL[0], max=1e6 * PIXEL[1], step=0.01,
                hint="Distance between samples; all lengths along the surface scale with it",
            )  # fmt: skip
            self._drop = gui.add_upload_button(
                "Image or array of heights", icon="upload",
                mime_type=",".join(IMAGE_SUFFIXES),
            )  # fmt: skip
            self._apply = gui.add_button("Apply", color="green")
        with gui.add_folder("Meshes of your own", expand_by_default=False):
            self._choices = {}
            for which, kind in (("tool", "file_tool"), ("target", "block")):
                self._choices[which] = gui.add_dropdown(which, [*MESHES, FILE], initial_value=kind)
                button = gui.add_upload_button(
                    f"Mesh of the {which}", icon="upload", mime_type=",".join(MESH_SUFFIXES)
                )
                button.on_upload(self._dropped("Mesh", partial(self._keep_mesh, which)))
            self._unit = gui.add_dropdown("unit of the files", [STATED, *UNITS])
            self._build = gui.add_button("Make a scene of them", color="green")
        self._message = gui.add_markdown("")
        for control in (self._body, self._kind):
            control.on_update(self._show_sizes)
        self._drop.on_upload(self._dropped("Image", self._keep_image))
        self._apply.on_click(self._applied)
        self._build.on_click(self._built)

    def update(self, frame: Frame) -> None:
        """Show the bodies of a new scene."""
        if frame.generation == self._generation:
            return
        self._generation = frame.generation
        bodies = bodies_of(self._servo.config.scene)
        if tuple(bodies) != tuple(self._body.options):
            self._body.options = bodies
        self._kind.value = AS_IT_IS
        self._show_now()
        self._legend.content = _legend(self._servo.config.scene)

    def close(self) -> None:
        """Delete the uploads."""
        self._uploads.close()

    def _coloured(self, _: Any) -> None:
        self._legend.visible = self._by_height.value
        if self._view is not None:
            self._view.colour_by_height(self._by_height.value)

    def _show_sizes(self, event: Any) -> None:
        if from_browser(event):
            self._show_now()

    def _show_now(self) -> None:
        """Show the height and pixel size of the chosen texture."""
        kind = self._kind.value
        if kind == FILE:
            self._relief.value, self._pixel.value = 1e3 * _PLAIN_RELIEF, 1e6 * _PLAIN_PIXEL
            return
        field = texture_of(self._servo.config.scene, self._body.value)
        if kind in PATTERNS or kind in SURFACES:
            made = with_texture(self._servo.config, self._body.value, SURFACES.get(kind, kind))
            field = texture_of(made.scene, self._body.value)
        if field is not None:
            self._relief.value = round(1e3 * field.relief, 5)
            self._pixel.value = round(1e6 * field.pixel_size[0], 4)

    def _dropped(self, what: str, keep: Callable[[str, bytes], str]) -> Callable[[Any], None]:
        """Return the callback of an upload, which `keep` stores; it returns the message."""

        def dropped(event: Any) -> None:
            file = event.target.value
            self._message.content = "The file was refused; nothing has changed."

            def store() -> None:
                self._message.content = keep(file.name, file.content)

            attempt(event, what, store)

        return dropped

    def _keep_image(self, name: str, content: bytes) -> str:
        path = self._uploads.image(name, content)
        self._image = {"file": str(path), "border": "wrap"}
        self._kind.value = FILE
        self._show_now()
        return "The image has been uploaded: set its height and pixel size, then Apply."

    def _keep_mesh(self, which: str, name: str, content: bytes) -> str:
        self._meshes[which] = {"file": str(self._uploads.mesh(name, content))}
        self._choices[which].value = FILE
        return f"The {which}'s mesh has been uploaded: set its unit, then make a scene."

    def _applied(self, event: Any) -> None:
        body, kind = self._body.value, self._kind.value
        servo = self._servo

        def change() -> None:
            wanted: str | Mapping[str, Any] = SURFACES.get(kind, kind)
            relief, pixel = 1e-3 * self._relief.value, 1e-6 * self._pixel.value
            if kind == FILE:
                if self._image is None:
                    raise AsperityError("no file has been uploaded yet: choose an image first")
                wanted = {**self._image, "pixel_size": pixel, "height_range": relief}
            self._message.content = f"Preparing {body} ..."
            made = with_texture(
                servo.config, body, wanted,
                relief=None if kind == SMOOTH else relief,
                pixel_size=None if kind in (SMOOTH, FILE) else pixel,
            )  # fmt: skip
            servo.restart(made).result()

        done = attempt(event, f"Texture of {body}", change)
        self._message.content = f"{body}: {kind}." if done else "Nothing has changed."

    def _built(self, event: Any) -> None:
        servo = self._servo
        unit = None if self._unit.value == STATED else self._unit.value

        def change() -> None:
            parts = {}
            for which, chosen in self._choices.items():
                if chosen.value == FILE and which not in self._meshes:
                    raise AsperityError(
                        f"no file for the {which} has been uploaded: choose one first"
                    )
                made = chosen.value
                parts[which] = self._meshes[which] if made == FILE else {"kind": made}
            self._message.content = "Preparing the scene ..."
            servo.restart(with_meshes(servo.config, parts["tool"], parts["target"], unit)).result()

        done = attempt(event, "Scene of meshes", change)
        self._message.content = "A scene of meshes." if done else "Nothing has changed."


def _legend(scene: Scene) -> str:
    """Return the legend of the height colours, with the range of each textured body."""
    ranges = [
        f"{body.name}: {1e3 * min(f.lowest for f in body.fields):.3g} to "
        f"{1e3 * max(f.highest for f in body.fields):.3g} mm"
        for body in scene.bodies
        if body.fields
    ]
    return render("live_heights.html", ranges=ranges, gradient=css_gradient())
