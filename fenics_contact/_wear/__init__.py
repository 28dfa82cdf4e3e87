"""Wear over many cycles: jumps with their error, and shapes that follow."""
