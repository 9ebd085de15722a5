"""Contact regions, their normals, and what is remembered of them."""
