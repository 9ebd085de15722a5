"""A scene run once: recording, dataset, figures, vibration metrics, sound."""
