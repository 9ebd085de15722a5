"""Height textures: spline surfaces, bounds, procedural patterns, readers of files."""
