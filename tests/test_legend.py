"""The legend explains every colour that vertex marks have at the moment, and no others."""

from app.debugger.commands import Extent, Forward, Lock
from app.debugger.controller import Controller
from app.page_state.page_state import PageState
from app.page_state.selection import Selection
from app.palette import LOCKED, NOW, SELECTED, START, STEPPED, solid
from app.panels.legend import marks_html
from fairing.run.session import Session
from tests.small_scene import corner_scene, small_options


def test_every_colour_of_the_vertex_marks_is_explained_and_no_other():
    controller = Controller(Session(corner_scene(), small_options(schedule={"order": "sequential"})))
    page_state = PageState()

    def explained() -> set[str]:
        markup = marks_html(controller.wait_until_idle(), page_state)
        names = (("unmoved", START), ("moved", NOW), ("locked", LOCKED), ("selected", SELECTED), ("last step", STEPPED))
        return {name for name, color in names if f"{solid(color)}'></i>{name}<" in markup}

    try:
        assert explained() == {"unmoved"}
        controller.post(Lock((3,), locked=True))
        page_state.selection = Selection((4,))
        assert explained() == {"unmoved", "locked", "selected"}
        page_state.shown["vertices"] = False
        assert explained() == {"selected"}
        page_state.shown["vertices"] = True
        state = controller.wait_until_idle()
        while (state.vertices == state.trace.start).all():
            controller.post(Forward(Extent.ITERATION))
            state = controller.wait_until_idle()
        assert explained() == {"unmoved", "moved", "locked", "selected", "last step"}
        assert "paths" not in marks_html(state, page_state), "drawn as long as they are"
        page_state.magnification = 20
        assert "paths ×20" in marks_html(state, page_state)
    finally:
        controller.close()
