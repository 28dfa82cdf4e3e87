"""What is measured: one module a case, run in a process of its own, with one JSON object on its last line."""
