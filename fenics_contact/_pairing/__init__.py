"""Contact search: slave nodes and their counterparts on the master, nodal or mortar."""
