"""Displaced surfaces of bodies as points and triangles: for pictures, the viewer and baselines."""
