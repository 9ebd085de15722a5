"""Choice of the contact engine of a scene with a soft body."""

from __future__ import annotations

from asperity.scene.scene import Scene
from asperity.simulation.elastic_engine import ElasticEngine
from asperity.simulation.skin_engine import SkinEngine


def soft_engine(scene: Scene) -> SkinEngine | ElasticEngine | None:
    """Return the engine of a scene with a soft skin or an elastic body, None for a rigid one."""
    if scene.skin is not None:
        return SkinEngine(scene, scene.skin)
    return None if scene.elastic is None else ElasticEngine(scene, scene.elastic)
