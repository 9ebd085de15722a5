"""Poses, quaternions, twists and wrenches: checked, interpolated, moved between frames."""
