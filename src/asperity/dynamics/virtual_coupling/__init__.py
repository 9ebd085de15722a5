"""The virtual coupling between handle and tool; each integrator has its own file."""
