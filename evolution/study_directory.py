"""The study directory: one run directory per experiment and seed, and what they are."""

from pathlib import Path

from epuck_mj import files
from epuck_mj.errors import UserError
from evolution.run_directory import RunDirectory
from evolution.study_config import StudyConfig

PREFIX = "seed-"


class StudyDirectory:
    """`study.yaml` and `<experiment>/seed-<n>/`, each as a single run leaves it."""

    def __init__(self, path: Path):
        """Name the directory; nothing is touched yet."""
        self.path = path
        self.config = path / "study.yaml"
        self.yardstick = path / "wall-follower.json"

    def run(self, name: str, seed: int) -> RunDirectory:
        """The directory of one run."""
        return RunDirectory(self.path / name / f"{PREFIX}{seed}")

    def seeds(self, name: str) -> list[int]:
        """Seeds of which there is a directory, in ascending order."""
        found = (path.name for path in (self.path / name).glob(f"{PREFIX}*/"))
        numbers = (part.removeprefix(PREFIX) for part in found)
        # not seed-01, a copy that a person made: it would count as seed 1 again
        return sorted(int(n) for n in numbers if n.isdecimal() and str(int(n)) == n)

    def open(self, config: StudyConfig) -> None:
        """Make the directory, or go on with it; more experiments may join.

        Raises:
            UserError: if it is something else, another study, or cannot be written.
        """
        if files.is_file(self.path):
            raise UserError(f"output '{self.path}' is not a directory")
        with files.writing(self.path):
            if files.is_file(self.config):
                config = self.stored_config().merged(config, self.path)
            elif self.path.is_dir() and self._holds_anything():
                raise UserError(
                    f"output '{self.path}' is not empty and holds no study: expected "
                    "a new directory, or one with a study.yaml"
                )
            self.path.mkdir(parents=True, exist_ok=True)
            files.remove_leftovers(self.path)
            files.write_text(self.config, config.to_yaml())

    def _holds_anything(self) -> bool:
        """Whether more is there than what a killed writer left behind."""
        return set(self.path.iterdir()) > set(files.leftovers(self.path))

    def stored_config(self) -> StudyConfig:
        """The study that is there.

        Raises:
            UserError: if there is none, or it is damaged.
        """
        if not files.is_file(self.config):
            raise UserError(
                f"'{self.path}' is not a study: expected a file '{self.config}', as "
                "python -m evolution.study writes it"
            )
        return StudyConfig.from_yaml(self.config)
