"""Split runs: one run at a time here, with its trials in MuJoCo on workers."""

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing

from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import is_kinematic, on_wheels
from epuck_mj.step.control import TaskParameters, Trials
from evolution.judging.evaluation import CAPACITY, BatchEngine, Engine, Work
from evolution.run.means import Means
from evolution.settings.config import ExperimentConfig
from evolution.study.cluster.connection import Cluster, ClusterLost
from evolution.study.cluster.requirements import Requirements, requirements_of
from evolution.study.jobs import Event, Job, failure_log, failure_of, generations

CHUNKS_PER_THREAD = 2
"""Parts of a generation per thread: more balance the load, fewer cost less to send."""

ENGINES_KEPT = 4
"""Number of engines that a thread of a worker keeps."""


def split_runs(jobs: Sequence[Job], cluster: Cluster, racing: bool) -> Iterator[Event]:
    """Do one job after the other, each spread over all workers."""
    for job in jobs:
        failure = None
        try:
            means = Means(ClusterEngines(cluster, job.config), racing=racing)
            with closing(generations(job, means)) as steps:
                for evaluations in steps:
                    yield Event(job, evaluations)
            failure_log(job.directory).unlink(missing_ok=True)
        except ClusterLost:
            raise
        except Exception as error:
            failure = failure_of(job, error)
        yield Event(job, ended=True, failure=failure)


class ClusterEngines:
    """Maker of a run's engines; an `EngineMaker`."""

    def __init__(self, cluster: Cluster, config: ExperimentConfig):
        """Store what they are made of."""
        self._cluster, self._config = cluster, config

    def __call__(self, scene: Scene) -> Engine:
        """The engine for a scene: what takes seconds stays here.

        Raises:
            UserError: as `requirements_of`.
        """
        if is_kinematic(scene.name):
            return BatchEngine(scene, self._config.task)
        # a run that has climbed is on another robot than it began with
        robot = self._config.robot
        robot = on_wheels(robot) if self._config.climbs else robot
        required = requirements_of(self._config, robot)
        return ClusterEngine(self._cluster, required, self._config.task)

    def __str__(self) -> str:
        """Name of the engines in a run's provenance."""
        return "cluster"


class ClusterEngine:
    """Engine that runs parts of the trials on the threads of a cluster."""

    def __init__(self, cluster: Cluster, required: Requirements, task: TaskParameters):
        """Store the requirements on workers, and what a trial is."""
        self._cluster, self._required, self._task = cluster, required, task

    def run(self, work: Work) -> Trials:
        """See `Engine.run`.

        Raises:
            UserError: if the cluster is lost, or a worker refuses.
        """
        n_chunks = CHUNKS_PER_THREAD * max(1, self._cluster.n_threads())
        most = min(CAPACITY, math.ceil(len(work) / n_chunks))
        futures = [
            self._cluster.submit("trials", _trials, self._required, self._task, part)
            for part in work.chunks(most)
        ]
        return Trials.joined(self._cluster.results(futures))


def _trials(required: Requirements, task: TaskParameters, part: Work) -> Trials:
    """On a worker: `Engine.run` of a part of the work."""
    # a thread's own: an engine runs one batch at a time
    engines = _kept.__dict__.setdefault("engines", {})
    if (required, task) not in engines:
        required.refuse_another()
        if len(engines) == ENGINES_KEPT:
            engines.clear()
        scene = load_scene(required.robot, required.arena, required.control_step)
        engines[required, task] = BatchEngine(scene, task, threads=1)
    return engines[required, task].run(part)


_kept = threading.local()
