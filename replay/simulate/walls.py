"""Walls: large, seamless, periodic pictures from which the camera sees a part.

A wall is sampled twice per camera pixel along the flight and once across it, in camera pixels of a camera that looks
at it squarely; its rows and columns wrap around, so that a trajectory may be of any length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from axialnav.replay.simulate.textures import load_texture

Image = NDArray[np.float32]
OVERSAMPLING = 2  # wall samples per camera pixel along a row
PATCH_PX = 192  # side of a blended patch [camera px]
STAIN_EXPONENT = 2.5  # power of a damp stain falls as 1 / f^2.5
STAIN_AMPLITUDE = 0.3  # of a stain, in standard deviations of the texture
ROWS_PX, COLS_PX = 1344, 4224  # whole patches, and more than a 1080p frame sees in five frames
CENTRE_OF_PHOTOGRAPHS = ("concrete", "plaster", "rock")


@dataclass(frozen=True)
class Wall:
    """A wall picture.

    Parameters
    ----------
    name
        What it is, for tables.
    image
        Texture [-], float32, shape (rows, ``OVERSAMPLING`` * columns), periodic in both directions; only its
        shape matters, mean and contrast are set by the scene.
    """

    name: str
    image: Image

    def crop(self, row: int, rows: int, col: int, cols: int) -> Image:
        """Copy of a part that may run over the edges; rows and columns in camera px, shape (rows, 2 cols)."""
        height, width = self.image.shape
        strip = (
            self.image.take(np.arange(row, row + rows), axis=0, mode="wrap")
            if not _inside(row, rows, height)
            else self.image[row % height : row % height + rows]
        )
        first, count = (OVERSAMPLING * col) % width, OVERSAMPLING * cols
        pieces = [strip[:, first : first + count]]
        missing = count - pieces[0].shape[1]
        while missing > 0:
            pieces.append(strip[:, :missing])
            missing -= pieces[-1].shape[1]
        return np.hstack(pieces) if len(pieces) > 1 else pieces[0].copy()


def _inside(row: int, rows: int, height: int) -> bool:
    return row % height + rows <= height


def photographic_wall(
    rng: np.random.Generator,
    photographs: Sequence[str] = CENTRE_OF_PHOTOGRAPHS,
    rows_px: int = ROWS_PX,
    cols_px: int = COLS_PX,
    stain: float = STAIN_AMPLITUDE,
    magnification: float = 1.0,
) -> Wall:
    """Mix shipped photographs by random patches without losing variance, and add a damp stain.

    Patches overlap by half under sine windows whose squares sum to one: the mean of independent textures would
    lose half of its variance between the patches, this does not.

    Parameters
    ----------
    rng
        Chooses patches, flips and the stain.
    photographs
        Names of ``textures.NAMES``.
    rows_px, cols_px
        Size [camera px], rounded up to whole patches.
    stain
        Amplitude of the stain in standard deviations of the texture [-].
    magnification
        How much larger the photographs appear than two of their pixels per camera px [-]: a closer wall.
    """
    sources = [_camera_grid(load_texture(name), magnification) for name in photographs]
    hop = PATCH_PX // 2
    rows, cols = -(-rows_px // hop) * hop, -(-cols_px // hop) * hop
    image = _blend(sources, rows, cols, rng)
    image += np.float32(stain) * fractal_field(rows, cols, STAIN_EXPONENT, rng)
    return Wall("+".join(photographs), image)


def fractal_wall(
    rng: np.random.Generator, exponent: float = 2.0, rows_px: int = ROWS_PX, cols_px: int = COLS_PX
) -> Wall:
    """Wall whose power falls as ``1 / f^exponent`` in every direction."""
    return Wall(f"fractal {exponent:g}", fractal_field(rows_px, cols_px, exponent, rng))


def brick_wall(
    rng: np.random.Generator,
    brick_px: tuple[int, int] = (22, 66),
    mortar_px: int = 3,
    tone: float = 0.5,
    roughness: float = 0.3,
    rows_px: int = ROWS_PX,
    cols_px: int = COLS_PX,
) -> Wall:
    """Running bond of bricks; with ``tone = roughness = 0`` it is truly periodic.

    Parameters
    ----------
    rng
        Draws the bricks' tones and the roughness.
    brick_px
        Height and width of a brick with its mortar [camera px].
    mortar_px
        Width of the joints [camera px].
    tone, roughness
        Standard deviation of a brick's grey and of its surface, in steps between brick and mortar [-].
    """
    height, width = brick_px
    courses, columns = 2 * -(-rows_px // (2 * height)), -(-cols_px // width)
    row, col = np.arange(courses * height), np.arange(OVERSAMPLING * columns * width)
    course = row // height
    shifted = col[None, :] + (course % 2 * (OVERSAMPLING * width // 2))[:, None]
    number = (shifted // (OVERSAMPLING * width)) % columns
    joint = (row % height < mortar_px)[:, None] | (shifted % (OVERSAMPLING * width) < OVERSAMPLING * mortar_px)
    tones = (1.0 + tone * rng.standard_normal((courses, columns))).astype(np.float32)
    image = np.where(joint, np.float32(0.0), tones[course[:, None], number])
    if roughness > 0.0:
        image += np.float32(roughness) * fractal_field(len(row), columns * width, 1.5, rng)
    return Wall("brick", image.astype(np.float32))


def fractal_field(rows: int, cols: int, exponent: float, rng: np.random.Generator) -> Image:
    """Periodic Gaussian field with isotropic power ``1 / f^exponent``, zero mean, unit variance.

    ``rows`` and ``cols`` in camera px; shape (rows, ``OVERSAMPLING`` * cols).
    """
    white = rng.standard_normal((rows, OVERSAMPLING * cols), dtype=np.float32)
    spectrum = fft.rfft2(white, overwrite_x=True)
    fx = fft.rfftfreq(OVERSAMPLING * cols, 1.0 / OVERSAMPLING)[None, :].astype(np.float32)
    fy = fft.fftfreq(rows)[:, None].astype(np.float32)
    power = fx**2 + fy**2
    power[0, 0] = np.inf
    spectrum *= power ** np.float32(-0.25 * exponent)
    field = fft.irfft2(spectrum, s=white.shape, overwrite_x=True)
    return np.asarray(field / field.std(), dtype=np.float32)


def _camera_grid(texture: Image, magnification: float) -> Image:
    """Photograph (two samples per camera px both ways) on the wall's grid: rows averaged in pairs."""
    cols, rows = (round(side * magnification) for side in (texture.shape[1], texture.shape[0]))
    method = cv2.INTER_CUBIC if magnification > 1.0 else cv2.INTER_AREA
    larger = cv2.resize(texture, (cols, rows), interpolation=method)
    half = cv2.resize(larger, (cols, rows // OVERSAMPLING), interpolation=cv2.INTER_AREA)
    return np.asarray((half - half.mean()) / half.std(), dtype=np.float32)


def _blend(sources: list[Image], rows: int, cols: int, rng: np.random.Generator) -> Image:
    tall, wide = PATCH_PX, OVERSAMPLING * PATCH_PX
    window = np.outer(_sine_window(tall), _sine_window(wide)).astype(np.float32)
    image = np.zeros((rows + tall // 2, OVERSAMPLING * cols + wide // 2), dtype=np.float32)
    for row in range(0, rows, tall // 2):
        for col in range(0, OVERSAMPLING * cols, wide // 2):
            image[row : row + tall, col : col + wide] += window * _patch(sources, tall, wide, rng)
    image[: tall // 2] += image[rows:]
    image[:, : wide // 2] += image[:, OVERSAMPLING * cols :]
    return np.ascontiguousarray(image[:rows, : OVERSAMPLING * cols])


def _sine_window(length: int) -> NDArray[np.float64]:
    return np.sin(np.pi * (np.arange(length) + 0.5) / length)


def _patch(sources: list[Image], rows: int, cols: int, rng: np.random.Generator) -> Image:
    source = sources[rng.integers(len(sources))]
    row = int(rng.integers(source.shape[0] - rows + 1))
    col = int(rng.integers(source.shape[1] - cols + 1))
    flip_rows, flip_cols = rng.integers(2, size=2) * 2 - 1
    return source[row : row + rows, col : col + cols][::flip_rows, ::flip_cols]
