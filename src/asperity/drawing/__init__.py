"""The style of figures and pages, and a software renderer."""
