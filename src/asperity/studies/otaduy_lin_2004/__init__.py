"""How rough it feels: metrics of vibration, the paper's studies, and what they show."""
