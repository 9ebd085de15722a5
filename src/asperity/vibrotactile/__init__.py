"""Recorded-vibration models: fitted to runs, kept in files, and turned into vibration again."""
