"""Figure of the gap: in how many worlds policies keep how much fitness."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from epuck_mj.policies.wall_follower import YARDSTICK
from evolution.gap.transfer import SHARE_KEPT, Gap
from evolution.pages.style import PAGE, PRINT, YARDSTICK_LOOK, legend_below, looks
from evolution.pages.words import robot_name

SHARE_END = 1.2
"""End of the axis of shares, which may exceed 1."""


def kept_figure(gap: Gap, names: Mapping[str, str]) -> Figure:
    """Figure with a panel per robot and a line per experiment.

    Args:
        gap: what was measured.
        names: of its groups, for readers.
    """
    styles = looks(group for group in gap.groups if group != YARDSTICK)
    with matplotlib.rc_context(PRINT):
        figure = Figure(figsize=(PAGE, 3.2), layout="constrained")
        panels = figure.subplots(1, len(gap.transfers), sharey=True, squeeze=False)[0]
        lines: dict[str, Artist] = {}
        for axes, (robot, transfer) in zip(panels, gap.transfers.items(), strict=True):
            for group, members in gap.groups.items():
                share = np.sort(transfer.share[:, members].ravel())
                at_least = 1 - np.arange(share.size + 1) / share.size
                look = styles.get(group)
                (line,) = axes.step(
                    [0, *share, SHARE_END],
                    [1, *at_least],
                    where="pre",
                    **YARDSTICK_LOOK
                    if look is None
                    else {"color": look.color, "linestyle": look.dashes, "lw": 1.4},
                )
                lines[f"{names[group]} (n = {len(members)})"] = line
            axes.axvline(SHARE_KEPT, color="0.4", lw=0.8, ls=":")
            axes.set(
                title=robot_name(robot),
                xlabel="share of the fitness kept, at least",
                xlim=(0, SHARE_END),
                ylim=(0, 1),
            )
        panels[0].set_ylabel("share of policies and worlds")
        # the lines are the same in all panels
        legend_below(figure, lines)
    return figure
