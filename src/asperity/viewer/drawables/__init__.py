"""What the page draws: displaced surfaces as coloured meshes."""
