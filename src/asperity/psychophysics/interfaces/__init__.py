"""Interfaces to the participant: terminal, page in the browser, simulated participant."""
