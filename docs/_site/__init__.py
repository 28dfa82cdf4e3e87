"""What Sphinx needs to know about this project beyond its settings."""
