"""Heights from files: images, arrays, instrument formats, normal maps."""
