"""Low-resolution bodies of the paper's colour plates 5 and 6, made by code."""
