"""Who answers: a terminal, the page, or a simulated participant."""
