"""Joins acquisition and analysis: command line `droptower`, HTTP service and page."""
