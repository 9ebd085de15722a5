"""The servo loop: a process that renders forces at a fixed rate."""
