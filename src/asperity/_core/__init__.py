"""What everything else stands on: compiled kernels, stack arrays, clock, result folders."""
