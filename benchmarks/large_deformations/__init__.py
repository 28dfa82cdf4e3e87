"""Published problems of plasticity and large deformations: converged values with their error bars."""
