"""Band of stages: a bar with a part for each stage of the record, named where there is room. Used by timelines."""

from collections.abc import Callable, Sequence

from app.debugger.stage_text import blur_text, stage_hint, stage_name
from app.html import text
from app.palette import css
from app.pictures.stage_colors import COLOR_OF_STAGE, stage_ground
from fairing.options import FairingOptions
from fairing.run.recorded_stages import RecordedStage
from fairing.stage_kind import StageKind


def stage_band(
    stages: Sequence[RecordedStage], options: FairingOptions, length: int, moment: int, go_to: Callable[[int], str]
) -> str:
    """Markup of the band over a record of `length` > 0 steps. The stage of the step before `moment` is marked.

    Args:
        go_to: JavaScript that goes to a moment; pressed, a stage goes to its beginning.
    """
    parts = []
    for stage in stages:
        is_now = stage.begin < moment <= stage.end
        place = f"left:{100 * stage.begin / length:.3f}%;width:{100 * (stage.end - stage.begin) / length:.3f}%"
        look = f"background:{stage_ground(stage.kind)};border-color:{css(COLOR_OF_STAGE[stage.kind])}"
        name = text(stage_name(stage.kind, stage.level, options))
        label = f"<span>{name}</span>"
        if stage.kind is StageKind.PHOTOS:
            label = f"<span class='long'>{name}</span><span class='short'>{blur_text(stage.level, options)}</span>"
        hint = text(f"{stage_hint(stage, options)} Click to go to its beginning.")
        parts.append(
            f"<div class='stage{' now' if is_now else ''}' role='listitem' aria-label='{name}' title='{hint}' "
            f'style="{place};{look}" onpointerdown="{text(go_to(stage.begin))}">{label}</div>'
        )
    return f"<div class='stages one' role='list' aria-label='Stages'>{''.join(parts)}</div>"
