"""From depths to forces: shares of stiffness, friction, baseline laws."""
