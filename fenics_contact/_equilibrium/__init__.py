"""Equilibrium of scenes with contact and friction."""
