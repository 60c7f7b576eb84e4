"""The sections of a report, each in a file that is named after its heading."""
