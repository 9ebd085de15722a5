"""Software renderer of scenes with displaced textures; needs no display and no driver."""
