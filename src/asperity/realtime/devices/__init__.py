"""Haptic devices, one a file, behind one small protocol."""
