"""The reality gap: champions in worlds that differ from the one they evolved in.

`python -m evolution.gap PATH...`: nobody's robot is the simulated one, so champions are
frozen and driven in a hundred pseudo-realities. Source of the idea: Koos, Mouret and
Doncieux, "The transferability approach", and Ligot and Birattari, "Simulation-only
experiments to mimic the effects of the reality gap" (cited from memory).
"""
