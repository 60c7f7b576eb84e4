"""How far fitness on each rung is from that on converged physics."""
