"""Which trial comes next: staircases, QUEST+, constant stimuli."""
