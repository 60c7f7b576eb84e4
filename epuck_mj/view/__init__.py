"""MuJoCo's own viewer with a champion: `python -m epuck_mj.view ARENA [CHAMPION]`."""
