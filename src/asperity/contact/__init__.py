"""Contact between textured bodies: low-resolution query, penetration depth, its gradient."""
