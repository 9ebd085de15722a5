"""Geometry of bodies: primitives, meshes, facets, convex pieces, displaced and offset surfaces."""
