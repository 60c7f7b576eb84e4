"""PPO of stable-baselines3 on the vector environment, beside evolution."""
