"""Which geoms and facets may touch."""
