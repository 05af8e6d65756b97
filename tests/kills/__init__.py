"""Kills: `python -m tests.kills --times 100` ends runs at the worst moments and checks what they leave behind.

A run of a small scene is ended by SIGKILL at a random moment, before or after one of its renames, between the halves of a
write, while it resumes, or by a disk that fills up. After that every file of the output folder is complete, the trace holds
all steps done but at most one, and the resumed run writes the same bytes as one that was never ended.
"""
