"""What a user would write instead: one mesh, one Newton method, one direct solver."""
