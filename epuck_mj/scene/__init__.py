"""Where a robot drives: MJCF in, a compiled model and its geometry out."""
