"""Recordings of people who speak and gesture, and the database that the search runs on."""
