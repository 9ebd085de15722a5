"""Procedures that choose the next trial: staircases, QUEST+, constant stimuli."""
