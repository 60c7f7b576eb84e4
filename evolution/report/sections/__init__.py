"""The sections of a report, each in a file that is called as its heading."""
