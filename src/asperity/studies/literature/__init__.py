"""Published findings about roughness through a probe, as code: what comes out and what not."""
