"""SciPy's optimisers beside the bundle method, on the shape of the chain."""
