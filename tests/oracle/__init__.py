"""Penetration depth by brute force on really displaced surfaces, for comparison."""
