"""What each numeric constant of the library does to its answers."""
