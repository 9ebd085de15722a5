"""The Haply Inverse3: by its service, by its serial port, and simulated."""
