"""What a looser tolerance of the states does to the subgradient and to the optimum."""
