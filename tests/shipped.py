"""The shipped optimisers: the paper's three and the baselines, by experiment."""

from evolution.settings.config_files import find_config, load_config

PAPERS = ("de-best", "de-rand", "ga")
BASELINES = (
    "random-search",
    "one-plus-one-es",
    "cma-es",
    "lra-cma-es",
    "l-shade",
    "openai-es",
    "ssshc",
)
OPTIMIZERS = {
    name: load_config(find_config(name)).optimizer for name in (*PAPERS, *BASELINES)
}
