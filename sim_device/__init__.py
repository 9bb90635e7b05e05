"""Plays an instrumented drop tower on real wires: recorder, gate, interlock, and a dart with an exact solver behind."""
