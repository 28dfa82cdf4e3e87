"""Forms of elasticity and of loads, written once on templates and bound to any mesh."""
