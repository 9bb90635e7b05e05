"""From the wires to run files that cannot be lost: drivers, acquisition, import, store and catalog."""
