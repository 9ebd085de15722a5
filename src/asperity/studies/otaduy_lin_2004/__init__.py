"""The studies of Otaduy & Lin (2004): stimuli, force models, drags, claims and figures."""
