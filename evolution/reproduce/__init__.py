"""The paper's claims with verdicts: `python -m evolution.reproduce`."""
