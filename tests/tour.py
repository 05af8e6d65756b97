"""Takes the pictures of the README and the guides: `python -m tests.tour [NAME ...]`.

It drives the debugger and an exported page in headless Chromium.
Every picture is a shot of the page in a window of 1280 x 720, saved as a small JPEG in app/pictures.

`python -m tests.tour talk FOLDER` writes three large pictures for a talk instead, see `tests/talk_pictures.py`, into a folder
that exists.
"""

import io
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import Browser, Page

import demo_scenes
from app.debugger.commands import JumpTo, Run
from app.debugger.run_state import Activity
from app.export.page import write_page
from app.export.picture import picture
from app.export.run_facts import RunFacts
from app.files.scene_source import SceneSource
from app.lessons.player import Status
from app.lessons.scenes import load_lesson_scene
from app.page.server import start
from demo_scenes import load_demo
from fairing.options import PRESETS, FairingOptions
from fairing.run.own_files import load_own
from fairing.run.recorded_stages import recorded_stages
from fairing.run.session import Session
from fairing.stage_kind import StageKind
from tests.browser.driver import WINDOW, Visitor, chromium, page_of
from tests.talk_pictures import NAMES, talk_picture
from tests.waiting import wait_for

PICTURES = Path(__file__).parents[1] / "app" / "pictures"
TERMS = Path(demo_scenes.__file__).parent / "terms"
QUALITY = 82
CORNER = 0  # vertex A; the others are held, as in the paper's first experiment
LESSON_STEP = 3  # from 0
SETTLED = 3  # so many shots in a row must be the same
MOST_SHOTS = 60
STORY_SCENE, STORY_VERTEX = "building:14", 42
STORY_STAGES = (StageKind.POINTS, StageKind.AXES, StageKind.SURFACE_POINTS)  # before the photos
STORY_BELOW = 152  # px, of the caption and the table
STATUS_HEIGHT = 108  # px, of the lines from "Paused" on
BACKGROUND = (26, 27, 30)
SHARES = (0.0, 0.3, 0.6, 0.95)  # of the corner's way to the truth, in the row of shots of a run


def main(wanted: list[str]) -> None:
    """Take the pictures of these names; all without a name."""
    options = replace(PRESETS["accurate"], locked_vertices=tuple(v for v in range(7) if v != CORNER))
    session = Session(load_demo("cube"), options)
    app = start(session, port=0)
    with chromium() as browser:
        visitor = Visitor(browser, app)
        visitor.close_notifications()
        page_of(app).interaction.select(CORNER)
        for name, take in DEBUGGER.items():
            take(visitor)
            if not wanted or name in wanted:
                save(name, settled(visitor.page))
        if not wanted or "replay" in wanted:
            save("replay", replay(browser.new_page(viewport=WINDOW, color_scheme="dark"), session))
        if not wanted or "lesson" in wanted:
            save("lesson", lesson(browser))
        if not wanted or "run" in wanted:
            save("run", run(browser, options))
        if not wanted or "story" in wanted:
            save("story", story(browser))
        if not wanted or "reload" in wanted:
            save("reload", reload(browser, options))
    app.stop()
    if not wanted or "before_after" in wanted:
        facts = RunFacts(session, PICTURES)
        save("before_after", picture(facts, None, lambda fraction: None))
    if not wanted or "capture" in wanted:
        save("capture", np.asarray(talk_picture("capture").resize((WINDOW["width"], WINDOW["height"]))))


def begin(visitor: Visitor) -> None:
    """The start, textures and all, from where the corner and the three sides around it are seen."""
    page_of(visitor.app).camera.show_front()


def two_steps(visitor: Visitor) -> None:
    visitor.press("Step one iteration")
    visitor.press("Step one iteration")


def in_the_photos(visitor: Visitor) -> None:
    visitor.page.get_by_text("In the photos", exact=True).click()


def through_a_camera(visitor: Visitor) -> None:
    visitor.page.get_by_text("Cells", exact=True).last.click()
    visitor.page.keyboard.press("3")


def at_the_end(visitor: Visitor) -> None:
    visitor.page.keyboard.press("0")
    visitor.press("Run")
    wait_for(lambda: visitor.app.controller.state.finished, seconds=120)


DEBUGGER: dict[str, Callable[[Visitor], None]] = {
    "start": begin,
    "debugger": two_steps,
    "photos": in_the_photos,
    "camera": through_a_camera,
    "end": at_the_end,
}


def replay(page: Page, session: Session) -> np.ndarray:
    """The exported page, half before and half now."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.html"
        write_page(RunFacts(session, path.parent), path, 2, lambda fraction: None)
        page.goto(path.as_uri())
        wait_for(lambda: page.evaluate("viewer?.loaded === data.keyframes.length"))
        page.get_by_role("button", name="Both", exact=True).click()
        page.evaluate("go(data.length)")
        return settled(page)


def lesson(browser: Browser) -> np.ndarray:
    """A step in the middle of the lesson on cells."""
    app = start(Session(load_lesson_scene("cube")), port=0, lesson="cells")
    visitor = Visitor(browser, app)
    visitor.close_notifications()
    player = page_of(app).lessons.player
    for step in range(LESSON_STEP + 1):
        wait_for(lambda step=step: player.step == step and player.status is Status.THERE, seconds=120)
        if step < LESSON_STEP:
            visitor.page.keyboard.press("PageDown")
    pixels = settled(visitor.page)
    app.stop()
    return pixels


def run(browser: Browser, options: FairingOptions) -> np.ndarray:
    """A row of shots of the 3D view while a run moves the corner: at shares of its way, from left to right."""
    scene = load_demo("cube")
    app = start(Session(scene, options), port=0)
    visitor = Visitor(browser, app)
    visitor.close_notifications()
    begin(visitor)
    settled(visitor.page)
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    way = np.linalg.norm(scene.truth.vertices[CORNER] - scene.mesh.vertices[CORNER])

    def share() -> float:
        vertices = app.controller.state.vertices
        return float(np.linalg.norm(vertices[CORNER] - scene.mesh.vertices[CORNER]) / way)

    canvas = visitor.canvas_box()
    middle = canvas["x"] + canvas["width"] / 2
    side = min(canvas["width"], visitor.box_of(visitor.page.get_by_role("tab", name="Timeline"))["y"] - 20)
    shots = []
    app.controller.post(Run())
    for wanted in SHARES:
        wait_for(lambda wanted=wanted: share() >= wanted)
        shots.append(_shot(visitor.page, (middle - side / 2, 0, side, side)))
        assert app.controller.state.activity is Activity.RUNNING
    app.stop()
    height = WINDOW["width"] // len(SHARES)
    return np.hstack([np.asarray(Image.fromarray(shot).resize((height, height))) for shot in shots])


def story(browser: Browser) -> np.ndarray:
    """A row of shots of one vertex of a building: what pulls at it when a stage begins, and the end."""
    scene = SceneSource.typed(STORY_SCENE, None, points="automatic").load()
    session = Session(scene)
    session.run()
    stages = recorded_stages(session.trace)
    photos = next(stage for stage in stages if stage.kind is StageKind.PHOTOS)
    begun = [next(stage for stage in stages if stage.kind is kind) for kind in STORY_STAGES]
    app = start(session, port=0)
    visitor = Visitor(browser, app)
    visitor.close_notifications()
    served = page_of(app)
    served.interaction.select(STORY_VERTEX)
    served.page_state.shown |= {"pulls": True, "cameras": False, "start": False}
    vertices = app.resources.stage.page_from_world(app.controller.state.vertices)
    served.camera.fly_to(STORY_VERTEX, vertices.astype(np.float64))
    columns = [_column(visitor, stage.begin, stage.kind.label) for stage in (*begun, photos)]
    columns.append(_column(visitor, len(session.trace), "the end"))
    app.stop()
    return np.hstack(columns)


def reload(browser: Browser, options: FairingOptions) -> np.ndarray:
    """A row of shots while the file of a term is edited: before, after a mistake, and the branch beside the old run."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(shutil.copy(TERMS / "rigidity.py", folder))
        code = file.read_text(encoding="utf-8")
        session = Session(load_demo("cube"), options.with_levels(smoothing=0.0), terms=load_own([file]).terms)
        app = start(session, port=0)
        visitor = Visitor(browser, app)
        visitor.close_notifications()
        begin(visitor)
        served = page_of(app)
        served.interaction.select(CORNER)
        served.page_state.shown |= {"pulls": True, "cameras": False}
        two_steps(visitor)
        visitor.page.get_by_role("tab", name="Runs").click()
        first = app.controller.wait_until_idle().run_id
        columns = [_edited(visitor, "rigidity.py as loaded: strength 0.1")]
        file.write_text(code.replace("return fairing", "retrun fairing"), encoding="utf-8")
        wait_for(lambda: "line" in app.controller.state.problem)
        columns.append(_edited(visitor, "saved with a mistake"))
        visitor.close_notifications()
        file.write_text(code.replace("strength = 0.1", "strength = 3.0"), encoding="utf-8")
        wait_for(lambda: app.controller.state.run_id != first)
        app.controller.wait_until_idle()
        columns.append(_edited(visitor, "saved with strength 3"))
        app.stop()
    return np.hstack(columns)


def _edited(visitor: Visitor, caption: str) -> np.ndarray:
    """The 3D view with the runs below it, what the status says, and what pulls at the selected vertex."""
    page = visitor.page
    shot = Image.fromarray(settled(page))
    canvas, table = visitor.canvas_box(), visitor.box_of(page.locator(".ef table.pulls"))
    right, below = table["x"], WINDOW["height"] - 2
    status = visitor.box_of(page.get_by_text("Paused", exact=True))["y"] - 6
    parts = [
        (canvas["x"], 0.0, canvas["x"] + canvas["width"], below),
        (right, status, right + table["width"], status + STATUS_HEIGHT),
        (right, table["y"], right + table["width"], table["y"] + table["height"]),
    ]
    width = WINDOW["width"] // 3
    shown = [shot.crop((round(x), round(y), round(end), round(bottom))) for x, y, end, bottom in parts]
    shown = [part.resize((width - 8, round(part.height * (width - 8) / part.width))) for part in shown]
    column = Image.new("RGB", (width, 24 + sum(part.height for part in shown)), BACKGROUND)
    ImageDraw.Draw(column).text((8, 4), caption, "white", ImageFont.load_default(15))
    top = 24
    for part in shown:
        column.paste(part, (4, top))
        top += part.height
    return np.asarray(column)


def _column(visitor: Visitor, moment: int, stage: str) -> np.ndarray:
    """The surroundings of the selected vertex at a moment, the stage that begins there, and the table of what pulls."""
    app, page = visitor.app, visitor.page
    app.controller.post(JumpTo(moment))
    app.controller.wait_until_idle()
    table = page.locator(".ef table.pulls")
    wait_for(lambda: table.count() == 1 and "at moment" not in table.inner_text())
    settled(page)
    canvas = visitor.canvas_box()
    x, y = visitor.drawn_at(STORY_VERTEX)
    width = WINDOW["width"] // (len(STORY_STAGES) + 2)
    view = Image.fromarray(_shot(page, (canvas["x"] + x - width / 2, canvas["y"] + y - width / 2, width, width)))
    column = Image.new("RGB", (width, width + STORY_BELOW), BACKGROUND)
    column.paste(view, (0, 0))
    if not app.controller.state.finished:
        table.evaluate("element => element.scrollIntoView({block: 'end'})")
        box = visitor.box_of(table)
        pulls = Image.fromarray(_shot(page, (box["x"], box["y"], box["width"], box["height"])))
        pulls = pulls.resize((width - 16, round(pulls.height * (width - 16) / pulls.width)))
        column.paste(pulls, (8, width + 34))
    scene = app.controller.scene
    assert scene.truth is not None
    assert scene.truth.vertices is not None
    off = np.linalg.norm(app.controller.state.vertices[STORY_VERTEX] - scene.truth.vertices[STORY_VERTEX])
    text = f"{stage}: {100 * off / scene.mesh.diagonal:.3f} % off"
    ImageDraw.Draw(column).text((8, width + 8), text, "white", ImageFont.load_default(15))
    return np.asarray(column)


def settled(page: Page) -> np.ndarray:
    """(h, w, 3) uint8: the page, once it no longer changes."""
    shots: list[bytes] = []
    while len(shots) < MOST_SHOTS and (len(shots) < SETTLED or len(set(shots[-SETTLED:])) > 1):
        page.wait_for_timeout(500)
        shots.append(page.screenshot())
    return _pixels(shots[-1])


def _shot(page: Page, clip: tuple[float, float, float, float]) -> np.ndarray:
    """(h, w, 3) uint8: a part of the page: left, top, width and height, px."""
    x, y, width, height = clip
    return _pixels(page.screenshot(clip={"x": x, "y": y, "width": width, "height": height}))


def _pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def save(name: str, pixels: np.ndarray) -> None:
    path = PICTURES / f"{name}.jpg"
    Image.fromarray(pixels).save(path, quality=QUALITY, optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    if sys.argv[1:2] == ["talk"]:
        for name in NAMES:
            talk_picture(name).save(Path(sys.argv[2]) / f"{name}.png")
    else:
        main(sys.argv[1:])
