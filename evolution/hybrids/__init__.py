"""Evolution that learns, compared with DE/best and with its controls."""
