"""Lessons: the Markdown files in this folder."""
