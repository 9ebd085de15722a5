"""1-D force models, one a file."""
