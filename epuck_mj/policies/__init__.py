"""Policies: the evolved network, its file, the hand-written follower."""
