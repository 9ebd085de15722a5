"""Generator of the meshes that the package ships: hammer, file and machined part.

`python -m tools.shapes` writes them; `asperity.geometry.shapes` reads them.
"""
