"""The way back: surfaces that have a wanted roughness, spectrum or distance, ready to print."""
