"""The reality gap: champions in worlds that differ from the one they evolved in.

`python -m evolution.gap PATH...`: no real robot is exactly the simulated one, so frozen
champions drive in a hundred pseudo-realities. Source of the idea: Koos, Mouret and
Doncieux, "The transferability approach", and Ligot and Birattari, "Simulation-only
experiments to mimic the effects of the reality gap" (cited from memory).
"""
