"""What accuracy costs: meshes refined where it pays, compared with meshes refined everywhere."""
