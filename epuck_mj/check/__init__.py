"""What is in an arena, and what is wrong with it: `python -m epuck_mj.check my.xml`."""
