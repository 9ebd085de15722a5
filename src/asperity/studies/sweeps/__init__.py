"""Large studies: parameters of a drag or of a scene, many processes, one store."""
