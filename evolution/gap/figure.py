"""Figure of the gap: in how many worlds policies keep how much fitness."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from epuck_mj.show.colors import TRIALS, fraction
from evolution.gap.transfer import SHARE_KEPT, Gap
from evolution.pages.style import PAGE, PRINT
from evolution.pages.words import robot_name

DASHES = ("-", (0, (7, 2)), (0, (2, 1.5)), (0, (7, 1.5, 1.2, 1.5)))

SHARE_END = 1.2
"""End of the axis of shares, which may exceed 1."""


def kept_figure(gap: Gap) -> Figure:
    """Figure with a panel per robot and a line per experiment."""
    with matplotlib.rc_context(PRINT):
        figure = Figure(figsize=(PAGE, 2.9), layout="constrained")
        panels = figure.subplots(1, len(gap.transfers), sharey=True, squeeze=False)[0]
        for axes, (robot, transfer) in zip(panels, gap.transfers.items(), strict=True):
            for i, (group, members) in enumerate(gap.groups.items()):
                share = np.sort(transfer.share[:, members].ravel())
                at_least = 1 - np.arange(share.size + 1) / share.size
                axes.step(
                    [0, *share, SHARE_END],
                    [1, *at_least],
                    where="pre",
                    label=f"{group} (n = {len(members)})",
                    color=fraction(TRIALS[i % len(TRIALS)]),
                    linestyle=DASHES[i % len(DASHES)],
                    lw=1.4,
                )
            axes.axvline(SHARE_KEPT, color="0.4", lw=0.8, ls=":")
            axes.set(
                title=robot_name(robot),
                xlabel="share of the fitness kept, at least",
                xlim=(0, SHARE_END),
                ylim=(0, 1),
            )
        panels[0].set_ylabel("share of policies and worlds")
        figure.legend(
            *panels[0].get_legend_handles_labels(),
            loc="outside lower center",
            ncols=min(4, len(gap.groups)),
        )
    return figure
