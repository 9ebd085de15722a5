"""The virtual coupling between handle and tool, and its integrators, one a file."""
