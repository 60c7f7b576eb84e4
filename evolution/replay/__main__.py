"""`python -m evolution.replay`."""

from epuck_mj.command_line import main
from evolution.replay.command import replay

if __name__ == "__main__":
    main(replay)
