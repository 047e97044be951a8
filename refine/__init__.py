"""Refinement: from chosen windows to one smooth motion."""
