"""The loop that runs while somebody feels: at a steady rate, recorded, and safe to touch."""
