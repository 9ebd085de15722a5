"""Large studies: many combinations of parameters, run by many processes into one store."""
