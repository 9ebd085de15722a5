"""The largest stable stiffness of a scene."""
