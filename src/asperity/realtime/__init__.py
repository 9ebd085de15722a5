"""Haptic rendering in real time: devices, and the servo loop that runs them."""
