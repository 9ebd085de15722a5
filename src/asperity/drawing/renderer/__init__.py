"""Pictures of a scene with its texture really displaced, drawn in memory: no display, no driver."""
