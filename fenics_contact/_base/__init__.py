"""Checkpoints: long runs store all that they need to continue, in atomically written files."""
