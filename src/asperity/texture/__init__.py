"""Height textures: spline interpolation, bounds, procedural textures, reading of files."""
