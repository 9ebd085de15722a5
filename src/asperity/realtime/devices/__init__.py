"""Haptic devices behind one small protocol, one backend per file."""
