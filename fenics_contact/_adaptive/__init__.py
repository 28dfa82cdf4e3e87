"""Meshes and solver effort that follow the accuracy one asks for."""
