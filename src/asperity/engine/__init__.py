"""From a pose of the tool to the wrench on it."""
