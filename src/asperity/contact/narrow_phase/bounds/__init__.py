"""Upper bounds of texture, overlap and curvature over a box of parameters."""
