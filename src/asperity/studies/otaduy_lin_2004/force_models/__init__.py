"""Force models along one line, one a file."""
