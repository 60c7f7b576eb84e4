"""How to get every number again: files, commands, and where the runs came from."""

from typing import Any

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.pages.blocks import Block, Code, Heading, Listing, Paragraph, Table
from evolution.pages.words import NOTHING, command_line, label
from evolution.settings.comparison import differences
from evolution.study.data import StudyData


def commands(data: StudyData, output: str, ioh: bool) -> dict[str, str]:
    """What to type to get every number again, by what it gives."""
    study = data.path.as_posix()
    run = next(run for runs in data.runs.values() for run in runs)
    name = next(name for name, runs in data.runs.items() if run in runs)
    config, again = f"again-{name}-{run.seed}.yaml", ["--ioh"] if ioh else []
    return {
        "this report": command_line(
            "evolution.report", study, "--output", output, *again
        ),
        "held-out fitness and behaviour of every champion": command_line(
            "evolution.evaluate", study
        ),
        "whether every champion scores the same on this machine": command_line(
            "evolution.verify", study
        ),
        "the hand-written wall follower": command_line("evolution.evaluate", YARDSTICK),
        "the config of one run (for other runs, change the name)": command_line(
            "evolution.export", run.path.as_posix(), config
        ),
        "that run, byte for byte": command_line(
            "evolution.run", config, "--output", f"runs/again-{name}-{run.seed}"
        ),
    }


def origins(data: StudyData) -> dict[str, list[Any]]:
    """Commits, versions, processors and arguments of all runs, each once, sorted."""
    found: dict[str, set[Any]] = {key: set() for key in (*ORIGINS, "argv")}
    for runs in data.runs.values():
        for run in runs:
            fields = run.provenance
            found["argv"] |= set(fields.get("commands", ()))
            for part in (fields, *fields.get("resumed", ())):
                for key, read in ORIGINS.items():
                    if part.get(key):
                        found[key].add(read(part[key]))
    return {key: sorted(values) for key, values in found.items()}


ORIGINS = {
    "git": lambda git: git["commit"] + (" and changes" if git["modified"] else ""),
    "versions": lambda versions: ", ".join(f"{k} {v}" for k, v in versions.items()),
    "processor": lambda processor: str(processor.get("model")),
}
"""Parts of a run's provenance that a report gives, and their texts."""


def how_to_get_every_number_again_section(
    data: StudyData, output: str, ioh: bool
) -> list[Block]:
    """Files, commands, and where the runs came from."""
    came_from = origins(data)
    blocks: list[Block] = [
        Heading("How to get every number again"),
        Listing(
            [
                "runs.csv: every run; runs-columns.csv: what its columns mean, and "
                "their units. The tables of this page are made from runs.csv, "
                "pairwise.csv, success.csv and targets.csv. summary.json has all "
                "numbers but those of single runs.",
                *(["ioh/: the histories, for IOHanalyzer."] if ioh else []),
                "Bootstrap intervals use random numbers from a fixed seed, so the same "
                "study gives the same bytes.",
            ]
        ),
    ]
    for what, line in commands(data, output, ioh).items():
        blocks += [Paragraph(f"{what[0].upper()}{what[1:]}:"), Code([line])]
    blocks += [
        Paragraph(
            "The runs were begun with these arguments of python -m evolution.study or "
            "evolution.run:"
        ),
        Code(came_from["argv"] or [NOTHING]),
        Paragraph("Code, versions and processors of the runs:"),
        Listing(
            [
                f"commit {NOTHING if not came_from['git'] else ''}"
                + "; ".join(came_from["git"]),
                *came_from["versions"],
                *came_from["processor"],
            ]
        ),
    ]
    differing = differences(data.configs, ("seed",))
    if differing:
        names = list(data.configs)
        blocks += [
            Paragraph("The experiments differ in these keys:"),
            Table(
                ("key", *(label(data, name) for name in names)),
                [
                    (key, *(str(values.get(name, NOTHING)) for name in names))
                    for key, values in differing.items()
                ],
            ),
        ]
    return blocks
