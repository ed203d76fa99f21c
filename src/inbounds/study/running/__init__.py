"""How cells are run, measured and verified: one at a time, many on a machine, or on a cluster."""
