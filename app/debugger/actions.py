"""Actions: the commands that have a button, keys or an entry in the command palette, and the list of keys."""

from dataclasses import dataclass

from app.debugger.commands import Back, Command, Extent, Forward, JumpTo, Pause, Restart, Run, RunBack, SaveReport
from app.keys import Key, key_text

BLOCK_NAMES = {"sequential": "vertex", "worst_first": "vertex", "independent": "set", "joint": "all"}
"""What is stepped at once, by the order of the schedule."""
BLOCK_STEPS = {"independent": "one set of vertices", "joint": "all vertices once"}


@dataclass(frozen=True)
class Action:
    """A command with its label and keys.

    Attributes:
        name: short and unique.
        label: shown in the palette and the tooltip.
        command: posted to the controller.
        keys: (key, modifier) pairs; the first is shown.
        icon: name of a shape in `app.html`; empty: no button.
        mirrored: draw the icon pointing backward.
    """

    name: str
    label: str
    command: Command
    keys: tuple[Key, ...] = ()
    icon: str = ""
    mirrored: bool = False

    @property
    def hint(self) -> str:
        """Tooltip: the label and its keys."""
        return self.hint_in("sequential")

    def label_in(self, order: str) -> str:
        """The label where vertices are stepped in this order of the schedule: one by one, in sets, or all at once."""
        return self.label.replace("one vertex", BLOCK_STEPS.get(order, "one vertex"))

    def hint_in(self, order: str) -> str:
        """Tooltip in this order of the schedule."""
        label = self.label_in(order)
        return f"{label} ({', '.join(key_text(*key) for key in self.keys)})" if self.keys else label


ACTIONS: tuple[Action, ...] = (
    Action("run", "Run", Run(), (("F5", None), ("G", None)), "run"),
    Action("run_back", "Run back to a breakpoint", RunBack(), (("F5", "shift"), ("G", "shift")), "run", True),
    Action("pause", "Pause", Pause(), (("P", None), ("space", None)), "pause"),
    Action(
        "iteration", "Step one iteration", Forward(Extent.ITERATION), (("F11", None), ("I", None), (".", None)), "one"
    ),
    Action("unit", "Step one vertex", Forward(Extent.BLOCK), (("F10", None), ("N", None)), "two"),
    Action("sweep", "Step one sweep", Forward(Extent.SWEEP), (("F11", "shift"), ("O", None), ("]", None)), "bar"),
    Action("stage", "Step one stage", Forward(Extent.STAGE), (("N", "shift"),), "bars_two"),
    Action("level", "Step one level", Forward(Extent.LEVEL), (("L", None),), "bars"),
    Action("back_iteration", "Step back one iteration", Back(Extent.ITERATION), ((",", None),), "one", True),
    Action("back_unit", "Step back one vertex", Back(Extent.BLOCK), (("U", None),), "two", True),
    Action("back_sweep", "Step back one sweep", Back(Extent.SWEEP), (("[", None),), "bar", True),
    Action("back_stage", "Step back one stage", Back(Extent.STAGE), (("U", "shift"),), "bars_two", True),
    Action("back_level", "Step back one level", Back(Extent.LEVEL), (("[", "shift"),), "bars", True),
    Action("start", "Go to the start", JumpTo(0), (("H", None),), "start"),
    Action("end", "Go to the end of the record", JumpTo(-1), (("J", None),), "end"),
    Action("restart", "Restart", Restart(), (("R", None),), "restart"),
    Action("report", "Save a problem report", SaveReport()),
)


CAMERA_KEYS = (("1 – 9", "Look through a camera"), ("0", "Leave the camera"))
VERTEX_KEYS = (
    (";", "Previous move of the selected vertex"),
    ("'", "Next move of the selected vertex"),
    ("F", "Lock or unlock the selected vertices"),
    ("Z", "Reset the selected vertices to their start"),
    ("B", "Breakpoint on the selected vertex"),
    ("T", "Play or stop the record"),
    ("K", "Bookmark this moment"),
    ("C", "Compare with this moment"),
    ("Shift+I", "Step into the next iteration"),
    ("Shift+J", "Next part of the iteration"),
    ("Shift+K", "Previous part of the iteration"),
    ("X", "Surface at the start or now"),
    ("-", "Texture: static or view-dependent"),
    ("Y", "Dark or light theme"),
    ("Shift+P", "Presenter layout"),
    ("M", "View: mesh"),
    ("V", "View: mesh and all cameras"),
    ("Shift+F", "View: front"),
    ("Shift+T", "View: top"),
    ("Page Down", "Next step of the lesson"),
    ("Page Up", "Previous step of the lesson"),
    ("Ctrl+K", "All commands"),
    ("?", "Keys"),
)


KEY_LABELS = dict(CAMERA_KEYS + VERTEX_KEYS)
"""What the keys without an action are called, in the list of keys and in the palette alike."""


FIRST_ACTIONS, FIRST_KEYS = ("run", "pause", "iteration", "back_iteration"), ("1 – 9", "0", "Ctrl+K", "?")


def label_of(command: Command) -> str:
    """A command in words: the label of its action, or the name of its kind."""
    for action in ACTIONS:
        if action.command == command:
            return action.label
    words = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in type(command).__name__)
    return words.strip().capitalize()


def key_list(order: str) -> list[tuple[str, str]]:
    """The rows of the help: keys and what they do in this order of the schedule."""
    actions = [
        (", ".join(key_text(*key) for key in action.keys), action.label_in(order)) for action in ACTIONS if action.keys
    ]
    return [*actions, *CAMERA_KEYS, *VERTEX_KEYS]


def first_keys() -> list[tuple[str, str]]:
    """What a newcomer needs first: keys and what they do."""
    actions = [(key_text(*action.keys[0]), action.label) for action in ACTIONS if action.name in FIRST_ACTIONS]
    return [*actions, *((key, KEY_LABELS[key]) for key in FIRST_KEYS)]
