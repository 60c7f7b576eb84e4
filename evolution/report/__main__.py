"""`python -m evolution.report`."""

from epuck_mj.command_line import main
from evolution.report.command import report

if __name__ == "__main__":
    main(report)
