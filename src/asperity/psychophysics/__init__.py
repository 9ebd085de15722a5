"""Experiments with people: what they are asked, how it is kept, what follows from it."""
