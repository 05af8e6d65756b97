"""The debugger without a browser: the controller, its commands and states, runs, breakpoints, conditions and history.

`Controller` accepts commands from any thread and publishes `RunState`s:

- `command_queue`, `interpreter`, `runs`, `manual_edits`, `playback`, `race`: what the commands do, on the engine thread;
- `run_state`, `session_snapshot`, `work_report`, `sweep_progress`, `publisher`: the published states;
- `engine_compilation`, `overload_memory`, `compile_watch`: the compilation of the engine, at its first start and later;
- `supervisor`, `incidents`, `problem_report`, `cancellation`: failures, and threads that do not respond;
- `markers` with `breakpoints`, `bookmarks`, `condition`, `quantities`: what stops a run;
- `history`, `error_history`, `series`, `recorded_values`, `compare`, `watch`: views of a record;
- `energy_profile`: the energy around a vertex while it is moved.

May import `fairing` and the loose modules of `app`; never viser.
"""
