"""Everything a user can make the engine do: one list for buttons, keys and the command palette."""

from dataclasses import dataclass

from app.debugger.commands import Back, Command, Extent, Forward, JumpTo, Pause, Restart, Run, RunBack


@dataclass(frozen=True)
class Action:
    """Attributes:
    name: short and unique.
    label: what the palette and the tooltip say.
    command: what is posted.
    keys: (key, modifier) pairs; the first is shown.
    icon: shape in `app.html`, mirrored for backward.
    """

    name: str
    label: str
    command: Command
    keys: tuple[tuple[str, str | None], ...] = ()
    icon: str = ""
    mirrored: bool = False

    @property
    def hint(self) -> str:
        """Tooltip: the label and its keys."""
        if not self.keys:
            return self.label
        return f"{self.label} ({', '.join(key_text(*key) for key in self.keys)})"


ACTIONS: tuple[Action, ...] = (
    Action("run", "Run", Run(), (("F5", None), ("G", None)), "run"),
    Action("run_back", "Run back to a breakpoint", RunBack(), (("F5", "shift"), ("G", "shift")), "run", True),
    Action("pause", "Pause", Pause(), (("P", None), ("space", None)), "pause"),
    Action(
        "iteration", "Step one iteration", Forward(Extent.ITERATION), (("F11", None), ("I", None), (".", None)), "one"
    ),
    Action("unit", "Step one vertex", Forward(Extent.UNIT), (("F10", None), ("N", None)), "two"),
    Action("sweep", "Step one sweep", Forward(Extent.SWEEP), (("F11", "shift"), ("O", None), ("]", None)), "bar"),
    Action("level", "Step one level", Forward(Extent.LEVEL), (("L", None),), "bars"),
    Action("back_iteration", "Back one iteration", Back(Extent.ITERATION), ((",", None),), "one", True),
    Action("back_unit", "Back one vertex", Back(Extent.UNIT), (("U", None),), "two", True),
    Action("back_sweep", "Back one sweep", Back(Extent.SWEEP), (("[", None),), "bar", True),
    Action("back_level", "Back one level", Back(Extent.LEVEL), (("[", "shift"),), "bars", True),
    Action("start", "To the start", JumpTo(0), (("H", None),), "start"),
    Action("end", "To the end of the record", JumpTo(-1), (("J", None),), "end"),
    Action("restart", "Restart", Restart(), (("R", None),), "restart"),
)


CAMERA_KEYS = (("1 – 9", "Look through a camera"), ("0", "Leave the camera"))
VERTEX_KEYS = (
    (";", "Previous move of the selected vertex"),
    ("'", "Next move of the selected vertex"),
    ("F", "Lock or unlock the selected vertices"),
    ("Z", "Put the selected vertices back to their start"),
    ("B", "Breakpoint on the selected vertex"),
    ("T", "Play the record, or stop"),
    ("K", "Bookmark this moment"),
    ("C", "Compare with this moment from now on"),
    ("X", "Surface before or now"),
    ("-", "Texture static or by the eye"),
    ("Y", "Dark or light"),
    ("M", "Show the mesh"),
    ("V", "Show mesh and cameras"),
    ("Page Down", "Next step of the lesson"),
    ("Page Up", "Back one step of the lesson"),
    ("Ctrl+K", "All commands"),
    ("?", "This list"),
)


def key_list() -> list[tuple[str, str]]:
    """Every key and what it does, for the help."""
    actions = [(", ".join(key_text(*key) for key in action.keys), action.label) for action in ACTIONS]
    return [*actions, *CAMERA_KEYS, *VERTEX_KEYS]


def key_text(key: str, modifier: str | None) -> str:
    """How a key is written for people."""
    key = "Space" if key == "space" else key
    return f"{modifier.capitalize()}+{key}" if modifier else key
