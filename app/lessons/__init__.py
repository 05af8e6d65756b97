"""Lessons: texts that control the engine and the page step by step, with claims that the engine verifies.

Belongs here: the lesson files (`texts/`, format in `reader`, actions in `vocabulary`), their parser and typesetter, the
player that runs the actions of a lesson, and the settings that a lesson step applies to the page.

May import: `app.debugger`, `app.page_state`, `app.files`, `app.pictures`, the loose modules of `app`, `demo_scenes` and
`fairing`; never viser. The panels of a lesson are in `app.panels`.

Offers: `load_lesson` and `lesson_names`, the `Player` of one browser, the `LessonProgress` that outlives its page, and
`SettingsApplier`.
"""
