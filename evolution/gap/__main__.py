"""`python -m evolution.gap`."""

from epuck_mj.command_line import main
from evolution.gap.command import gap

if __name__ == "__main__":
    main(gap)
