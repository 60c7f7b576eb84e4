"""What a control step does: sensors, motors, fitness, disturbances."""
