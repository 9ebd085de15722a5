"""What moves: the hand of the studies."""
