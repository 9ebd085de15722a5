"""Verdicts over an ensemble of hands and stimuli instead of one setting."""
