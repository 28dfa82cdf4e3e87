"""What Sphinx is told about this project beyond its settings."""
