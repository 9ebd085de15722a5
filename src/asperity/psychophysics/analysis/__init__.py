"""What the answers say: psychometric functions, magnitude estimates, scales."""
