"""What happened in trials: recorded, measured, put into classes."""
