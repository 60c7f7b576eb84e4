"""Many runs, side by side: `python -m evolution.study`."""
