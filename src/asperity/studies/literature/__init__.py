"""Published findings about roughness through a probe, tested on the force model as code."""
