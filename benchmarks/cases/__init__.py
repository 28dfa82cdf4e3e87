"""What is measured: one module a case, whose `measure` is called in a process of its own."""
