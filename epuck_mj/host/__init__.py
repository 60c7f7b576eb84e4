"""This computer: files, YAML and JSON, command lines, signals."""
