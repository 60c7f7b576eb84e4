"""The control step: sensors, motors, fitness, disturbances."""
