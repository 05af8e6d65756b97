"""Capture check: cameras, coverage, face sizes, texture, exposure and memory, before a run.

What belongs here: tests of the input that need no run. The check itself (`scene_check`, `result`), its measurements
(`appearance`, `conventions`, `memory`), and the texts that explain the findings (`hints`).

May import: the data modules of `fairing`, `fairing.util`, `fairing.geometry`, `fairing.cameras` and `fairing.cells`.

Offers: `check_scene` and `SceneCheck`; `memory_needed` and `memory_warning`; `explain_view` for cameras that miss the mesh.
"""
