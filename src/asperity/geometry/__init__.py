"""Surfaces, and the offset surfaces that a probe traces on them."""
