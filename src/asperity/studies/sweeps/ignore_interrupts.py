"""Preload of local workers: ignore SIGINT. Ctrl-C reaches them too; the client stops them."""

import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)
