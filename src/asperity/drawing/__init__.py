"""Style of figures, templates of pages, and a software renderer."""
