"""Evolution that learns, held against DE/best and against its controls."""
