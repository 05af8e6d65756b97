"""`texture`: a mesh with a texture from its photos, as a model for other programs."""

from pathlib import Path

import numpy as np
from rich.console import Console

from app.cli.arguments import ALL_PHOTOS, MeshArgument, PhotosArgument, SceneArgument
from app.cli.lines import note_outside_photos, print_line
from app.cli.loading import load_with_progress
from app.cli.progress_bar import progress_bar
from app.files.scene_source import SceneSource
from fairing.errors import InputError
from fairing.io.textured_mesh import check_textured_suffix, write_textured
from fairing.scene import Scene
from fairing.texture import TexturedModel, textured_model

SMALLEST_TEXTURE, DEFAULT_TEXTURE, LARGEST_TEXTURE = 64, 4096, 16384  # texels; every graphics card takes the default


def texture(
    scene: SceneArgument,
    out: Path,
    mesh: MeshArgument = None,
    size: int = DEFAULT_TEXTURE,
    photos: PhotosArgument = ALL_PHOTOS,
) -> int:
    """Write a mesh with a texture from the photos, for other programs.

    Args:
        out: The model: .glb, .obj (with .mtl and .png) or .ply (with .png).
        size: Largest width and height of the texture. Within this limit a texel is about as large as a photo pixel.
    """
    return texture_to_file(SceneSource.typed(scene, mesh, photos), out, size, Console(stderr=True))


def texture_to_file(source: SceneSource, out: Path, size: int, console: Console) -> int:
    """Write the textured mesh of a scene. An existing file is replaced only by a complete one.

    Returns:
        Exit code 0.

    Raises:
        InputError: the suffix or the size is not supported, or the texture is too small for the faces.
    """
    check_textured_suffix(out)
    if not SMALLEST_TEXTURE <= size <= LARGEST_TEXTURE:
        raise InputError(f"--size: expected {SMALLEST_TEXTURE} to {LARGEST_TEXTURE} texels, found {size}")
    scene = load_with_progress(source, console)
    note_outside_photos(console, source.scene, scene.views)
    model = paint_with_progress(scene, scene.mesh.vertices, size, console)
    written = write_textured(out, model)
    height, width = model.image.shape[:2]
    names = ", ".join([str(written[-1]), *(path.name for path in written[:-1])])
    print_line(console, f"texture {width}x{height}; wrote {names}")
    return 0


def paint_with_progress(scene: Scene, vertices: np.ndarray, size: int, console: Console) -> TexturedModel:
    """The textured model with the vertices and faces of the input; shows a progress bar.

    Raises:
        InputError: the texture is too small for the faces.
    """
    with progress_bar(console) as bar:
        task = bar.add_task("painting", total=1.0)
        try:
            model = textured_model(scene, vertices, size, lambda fraction: bar.update(task, completed=fraction))
        except ValueError as error:
            raise InputError(f"{error}; give a larger --size") from None
    uv = np.zeros((len(scene.original_faces), 3, 2))  # faces without area show nothing of the texture
    uv[scene.input_faces] = model.uv
    return TexturedModel(scene.unweld(model.vertices), scene.original_faces, uv, model.image)
