"""The Haply Inverse3: its service, its serial port, and a stand-in."""
