"""Environments for agents: the dm_control task, Gymnasium environments."""
