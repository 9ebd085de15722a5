"""Narrow phase: the deepest overlap of two textured surfaces along n, by branch and bound.

From the bottom up:

- `records`: all records, field by field, with units.
- `surface_patch`, `facet_patch`: the facing parts of a geom, and a facet, as `PATCH` records.
- `displaced_surface`, `displaced_plane`: points and heights of a textured patch, with derivatives.
- `overlap`: the overlap f(x, y) of two patches, which is maximised, and the limits of both.
- `newton_ascent`; `sphere_on_plane`, `flat_on_flat`: local maxima, and fast paths to them.
- `bounds`, `tighten`: upper bounds of f over a box, which certify the result.
- `branch_and_bound`: one pair of patches; `best_first`: many pairs of planes in one heap
  (`node_queue`), down to the smallest boxes (`leaves`).
- `warm_start`: pairs that cannot be as deep as the previous tick's contact are culled.
- `geom_depth`, `mesh_depth`: entry points, from two bodies to a `PENETRATION` record.
"""
