"""How accurate a state is: its errors by solver, friction law and mesh, in energy norm."""
