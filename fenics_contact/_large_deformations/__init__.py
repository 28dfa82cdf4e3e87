"""Large deformations and nonlinear materials: Newton's method on the torn system."""
