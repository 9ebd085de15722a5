"""A session of an experiment: trials, presentation, journal, tables."""
