"""From a scan to a haptic object: a mesh of few triangles, and a texture with all the rest."""
