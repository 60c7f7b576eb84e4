"""Outputs of a replay: a recording, a window, a page, a video or a picture."""

import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from epuck_mj.host.command_line import shell_command
from epuck_mj.host.files import writing
from epuck_mj.scene.model import Scene
from epuck_mj.show.recording import Trial, save_recording
from epuck_mj.step.fitness import of_most
from evolution.named_policies import NamedPolicy, described
from evolution.replay.options import Options
from evolution.replay.viewer import display_there, open_viewer
from evolution.replay.web import LOOPBACK, server, write_page

IMAGE_SIZE, VIDEO_SIZE = (1200, 800), (960, 640)
"""Width and height [pixels]."""


def outcome(trial: Trial) -> str:
    """Line with the fitness and the end of a trial."""
    trajectory = trial.trajectory
    end = f", crash after {trajectory.time[-1]:.1f} s" if trajectory.crashed else ""
    fitness = of_most(trajectory.trial_fitness, trial.task.most)
    return f"{trial.name}: fitness {fitness}{end}"


def text_panel(trials: Sequence[Trial], policies: Sequence[NamedPolicy]) -> str:
    """Text panel with the trials, then what is known of each policy."""
    lines = [f"- {outcome(trial)}" for trial in trials]
    known = [described(policy) for policy in policies]
    return "\n".join(["# Trials", "", *lines, "", *known])


@dataclass(frozen=True)
class Replay:
    """Trials to show, with their scene, title and summary."""

    scene: Scene
    trials: Sequence[Trial]
    title: str
    summary: str

    def save(self, path: Path) -> None:
        """Write the recording; its folder is made."""
        _make_folder(path)
        save_recording(path, self.scene, self.trials, self.title, self.summary)


def show(options: Options, replay: Replay, path: str) -> None:
    """Write the outputs asked for; by default a recording, which is opened."""
    trajectories = [trial.trajectory for trial in replay.trials]
    if options.save is not None:
        replay.save(options.save)
        print(f"{options.save}; watch it: {shell_command('rerun', options.save)}")
    if options.image is not None:
        _draw(options.image, replay)
        print(options.image)
    if options.video is not None:
        _film(options.video, replay.scene, trajectories)
        print(options.video)
    if options.web is not None:
        replay.save(options.web / "replay.rrd")
        _serve(options.web)
    if not (options.save or options.image or options.video or options.web):
        place = Path(path)
        # a run of a study is a row of a table, and no folder
        beside = place.parent if place.is_file() else Path()
        recording = (place if place.is_dir() else beside) / "replay.rrd"
        replay.save(recording)
        _open(recording)


def _open(recording: Path) -> None:
    """Open the viewer, or print how to view the recording."""
    how = f"watch it: {shell_command('rerun', recording)}"
    if not display_there():
        print(f"{recording}; there is no display here; {how}")
    elif reason := open_viewer(recording):
        print(f"{recording}; the viewer did not open ({reason}); {how}")
    else:
        print(f"{recording}, shown in the viewer")


def _make_folder(path: Path) -> None:
    """Make the folder of a file before the work that the file is for."""
    with writing():
        path.parent.mkdir(parents=True, exist_ok=True)


def _draw(path: Path, replay: Replay) -> None:
    # OpenGL and matplotlib are slow to import
    from epuck_mj.show.pictures import save_figure
    from epuck_mj.show.still import DPI, still

    _make_folder(path)
    trajectories = [trial.trajectory for trial in replay.trials]
    sensor_range = replay.trials[0].task.sensor_range
    figure = still(replay.scene, trajectories, sensor_range, IMAGE_SIZE)
    save_figure(figure, path, DPI)


def _film(path: Path, scene: Scene, trajectories: Sequence) -> None:
    # the same, and ffmpeg
    from epuck_mj.show.video import save_video

    _make_folder(path)
    with tqdm(unit="frame", disable=not sys.stderr.isatty()) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        save_video(path, scene, trajectories, *VIDEO_SIZE, show)


def _serve(folder: Path) -> None:
    """Write the web page and serve it until Ctrl-C."""
    write_page(folder)
    with server(folder) as web:
        address = f"http://{LOOPBACK}:{web.server_port}/"
        try:
            # from the moment it is promised
            print(f"{folder}, served at {address} until Ctrl-C", flush=True)
            if display_there():
                webbrowser.open(address)
            web.serve_forever()
        except KeyboardInterrupt:
            print()
