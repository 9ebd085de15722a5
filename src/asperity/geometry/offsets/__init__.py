"""Offset surfaces of profiles and height maps: where a round tip can be."""
