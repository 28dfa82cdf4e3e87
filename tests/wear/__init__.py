"""Wear over many cycles, and shapes that follow."""
