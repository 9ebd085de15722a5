"""The deepest overlap of two displaced surfaces, by branch and bound."""
