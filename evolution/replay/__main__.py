"""Watch champions drive: `python -m evolution.replay PATH [options]`."""

from collections.abc import Sequence

from epuck_mj.errors import UserError
from epuck_mj.host.command_line import check_ending, main, parse
from evolution.replay.options import Options

MODULE = "evolution.replay"


EXAMPLES = (
    "python -m evolution.replay runs/ga-seed-1",
    "python -m evolution.replay runs/ga-seed-1 --trials 4 --save trials.rrd",
)


def replay(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    check_ending("save", options.save, ".rrd")
    check_ending("video", options.video, ".mp4")
    check_ending("image", options.image, ".png")
    paths = [path for path in (options.path, *options.compare) if path]
    if not paths:
        raise UserError(
            "expected what to replay: a run directory, a controller file, "
            "wall-follower or a trajectory (.npz)"
        )
    conditions = options.robots.conditions
    # slow to import: after the checks of the command line
    from evolution.named_policies import named_policies
    from evolution.replay.choices import scene_for, starts_for
    from evolution.replay.output import Replay, outcome, show, text_panel
    from evolution.replay.trials import from_file, labels, simulated

    recorded = [from_file(path) for path in paths if path.endswith(".npz")]
    policies = [
        policy
        for path in paths
        if not path.endswith(".npz")
        for policy in named_policies(path, options.generations)
    ]
    scene = scene_for(options, policies)
    starts = starts_for(options, scene, policies)
    trials = [*simulated(scene, policies, starts, conditions), *recorded]
    where = ""
    if starts.typical_of:
        among = f"median fitness of the first {starts.typical_of}"
        where = f" (start test:{starts.first}, {among})"
    for trial in trials:
        print(f"{outcome(trial)}{where if trial not in recorded else ''}")
    title = ", ".join(labels(policies) or [trial.name for trial in recorded])
    text = text_panel(trials, policies)
    show(options, Replay(scene, trials, title, text), paths[0])
    return 0


if __name__ == "__main__":
    main(replay)
