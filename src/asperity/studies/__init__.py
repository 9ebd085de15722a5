"""Studies in simulation: the paper, the literature, stability, other methods, sweeps."""
