"""One file a rival: `solve(trial) -> (theta, message)`, theta = (rotation vector, translation) or None."""
