"""From the grip to the skin's channels: parts that the model of the paper leaves out."""
