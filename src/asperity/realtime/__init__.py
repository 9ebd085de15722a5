"""Haptic devices and the servo loop that drives them."""
