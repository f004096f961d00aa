"""What a camera in the corridor sees: every flat piece in view, the nearest in front."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.kernels import bring_nearer
from axialnav.replay.simulate.mission import WallLook
from axialnav.replay.simulate.optics import lens_taps
from axialnav.replay.simulate.posed import Poses, WallPlane, Window, posed_light
from axialnav.replay.simulate.rays import cast
from axialnav.replay.simulate.scene import CameraModel
from axialnav.replay.simulate.walls import Image, Wall
from axialnav.replay.simulate.world import Facet, World

Array = NDArray[np.float64]
PROBES = (13, 9)  # rays, across and down, that find what is in view
MOST_PROBES = 300
MARGIN_PX = 3
FAR_M = 25.0  # of a wall seen along its length: what is farther is a few px wide
UPRIGHT = ("left", "right", "end", "niche")


@dataclass(frozen=True)
class Group:
    """Pieces that lie in one plane and look the same, and their picture."""

    facets: tuple[int, ...]
    plane: WallPlane
    albedo: float


class CorridorView:
    """Renders a corridor.

    Parameters
    ----------
    world
        The corridor.
    camera
        The camera.
    pitch_m
        Size of a px of the walls' pictures [m].
    picture_of
        Gives the picture of a texture by name; asked once for each that comes into view.
    """

    def __init__(self, world: World, camera: CameraModel, pitch_m: float, picture_of: Callable[[str], Wall]) -> None:
        self._world, self._camera, self._pitch_m, self._picture_of = world, camera, pitch_m, picture_of
        self._group_of = _grouped(world.facets)
        self._groups: dict[int, Group] = {}

    def light(self, poses: Poses) -> Image:
        """Relative light on the sensor while the shutter is open, shape (h, w)."""
        position, rotation = (part[0] for part in poses(np.zeros(1)))
        seen = self._in_view(position, rotation)
        if len(seen) == 1:
            group = self._group(seen[0])
            return np.asarray(posed_light(group.plane, self._camera, poses) * np.float32(group.albedo))
        return self._composed(seen, position, rotation, poses)

    @property
    def groups(self) -> tuple[int, ...]:
        """Numbers of all groups of pieces."""
        return tuple(sorted(set(self._group_of)))

    def plane(self, number: int) -> WallPlane:
        """Plane and picture of a group."""
        return self._group(number).plane

    def _in_view(self, position: Array, rotation_WS: Array) -> list[int]:
        """Groups that a grid of rays meets."""
        camera = self._camera
        u, v = np.meshgrid(
            np.linspace(-MARGIN_PX, camera.width - 1 + MARGIN_PX, PROBES[0]),
            np.linspace(-MARGIN_PX, camera.height - 1 + MARGIN_PX, PROBES[1]),
        )
        rays = _rays(camera, u.ravel(), v.ravel()) @ rotation_WS.T
        hits = cast(self._world, np.broadcast_to(position, rays.shape), rays)
        return sorted({self._group_of[f] for f in hits.facet.tolist() if f >= 0})

    def _composed(self, seen: list[int], position: Array, rotation: Array, poses: Poses) -> Image:
        depths = self._depths(seen, position, rotation)
        missed = self._behind(np.asarray(~np.isfinite(depths).any(axis=0)), position, rotation)
        if missed:  # pieces so small that no probe met them
            seen = [*seen, *missed]
            depths = np.concatenate([depths, self._depths(missed, position, rotation)])
        nearest = np.argmin(depths, axis=0)
        dark = ~np.isfinite(depths).any(axis=0)
        out = np.zeros(nearest.shape, dtype=np.float32)
        taps = lens_taps(self._camera.lens_sigma_px)
        for k, number in enumerate(seen):
            mask = ((nearest == k) & ~dark).astype(np.float32)
            if mask.any():
                mask = cv2.sepFilter2D(mask, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REPLICATE)
                self._add(number, mask, position, rotation, poses, out)
        return out

    def _depths(self, groups: list[int], position: Array, rotation: Array) -> Image:
        """Depth at which each pixel meets each group [m], infinite where it does not, shape (groups, h, w)."""
        depths = np.full((len(groups), self._camera.height, self._camera.width), np.inf, dtype=np.float32)
        for depth, number in zip(depths, groups, strict=True):
            for index in self._group(number).facets:
                self._bring_nearer(self._world.facets[index], position, rotation, depth)
        return depths

    def _behind(self, pixels: NDArray[np.bool_], position: Array, rotation: Array) -> list[int]:
        """Groups that some of the marked pixels (h, w) look at."""
        v, u = np.nonzero(pixels)
        step = max(1, len(u) // MOST_PROBES)
        rays = _rays(self._camera, u[::step].astype(np.float64), v[::step].astype(np.float64)) @ rotation.T
        hits = cast(self._world, np.broadcast_to(position, rays.shape), rays)
        return sorted({self._group_of[f] for f in hits.facet.tolist() if f >= 0})

    def poses_before(self, number: int, poses: Poses) -> Poses:
        """The poses from which a group's plane is filmed: those flown while all of them are in front of it.

        Whoever passes the plane of a doorway's side while the shutter is open sees that side edge-on, a fraction of a
        pixel wide: it is filmed as it looks from the middle of the exposure.
        """
        plane, reach_s = self.plane(number), 0.5 * (self._camera.exposure_s + self._camera.readout_s)
        flown, _ = poses(np.array([-reach_s, 0.0, reach_s]))
        if (plane.depth_m(flown) > 0.0).all():
            return poses
        position, rotation = poses(np.zeros(1))
        return lambda delay: (np.repeat(position, len(delay), axis=0), np.repeat(rotation, len(delay), axis=0))

    def _add(self, number: int, mask: Image, position: Array, rotation: Array, poses: Poses, out: Image) -> None:
        """Put the part of a group that ``mask`` shows into the picture."""
        group = self._group(number)
        rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        window = Window(int(cols[0]), int(rows[0]), int(cols[-1] - cols[0] + 1), int(rows[-1] - rows[0] + 1))
        extent = self._extent(group, mask, position, rotation)
        light = posed_light(group.plane, self._camera, self.poses_before(number, poses), window, extent)
        part = np.s_[window.top : window.top + window.height, window.left : window.left + window.width]
        out[part] += mask[part] * light * np.float32(group.albedo)

    def _extent(self, group: Group, mask: Image, position: Array, rotation: Array) -> tuple[Array, Array]:
        """Part of the wall's picture that shows, from the mask's outline, limited to ``FAR_M`` [px of the wall]."""
        rows, cols = np.nonzero(mask)
        step = max(1, len(rows) // 4000)
        ends = np.concatenate([np.arange(0, len(rows), step), [np.argmin(cols), np.argmax(cols), len(rows) - 1]])
        pixels = np.column_stack([cols[ends], rows[ends], np.ones(len(ends))])
        seen = pixels @ group.plane.homography(position, rotation, self._camera).T
        seen = seen[seen[:, 2] > 1e-6]
        places = seen[:, :2] / seen[:, 2:]
        foot = (group.plane.axes[:2] @ (position - np.array(group.plane.origin_m))) / self._pitch_m
        reach = FAR_M / self._pitch_m
        places = np.clip(places, foot - reach, foot + reach)
        return places.min(axis=0) - MARGIN_PX, places.max(axis=0) + MARGIN_PX

    def _bring_nearer(self, facet: Facet, position: Array, rotation_WS: Array, depth: Image) -> None:
        """Lower ``depth`` (h, w) [m] to that of a piece where the camera sees it."""
        height = float(facet.normal @ position - facet.offset_m)
        if height <= 0.0:
            return
        cosine = -facet.normal @ rotation_WS
        inward = np.cross(facet.normal, np.roll(facet.corners, -1, axis=0) - facet.corners)
        slopes = np.einsum("ni,ni->n", inward, position - facet.corners)
        edges = slopes[:, None] * cosine + height * inward @ rotation_WS
        bring_nearer(np.vstack([cosine, edges]), height, self._camera.focal_px, depth)

    def _group(self, number: int) -> Group:
        if number not in self._groups:
            members = tuple(i for i, g in enumerate(self._group_of) if g == number)
            facet = self._world.facets[members[0]]
            plane = _plane(facet, self._picture_of(facet.look.texture), self._pitch_m)
            self._groups[number] = Group(members, plane, facet.look.albedo)
        return self._groups[number]


def _rays(camera: CameraModel, u_px: Array, v_px: Array) -> Array:
    """Unit rays of pixels in camera axes, shape (n, 3)."""
    x = (u_px - 0.5 * (camera.width - 1)) / camera.focal_px
    y = (v_px - 0.5 * (camera.height - 1)) / camera.focal_px
    rays = np.column_stack([x, y, np.ones_like(x)])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _grouped(facets: tuple[Facet, ...]) -> list[int]:
    """Number of the group of every piece: one plane and one look."""
    numbers: dict[tuple[tuple[float, ...], float, WallLook], int] = {}
    groups = []
    for facet in facets:
        key = (tuple((np.round(facet.normal, 6) + 0.0).tolist()), round(facet.offset_m, 4) + 0.0, facet.look)
        groups.append(numbers.setdefault(key, len(numbers)))
    return groups


def _plane(facet: Facet, picture: Wall, pitch_m: float) -> WallPlane:
    """The picture on the piece's plane; walls hang level, so that neighbours continue one another."""
    right = facet.corners[1] - facet.corners[0]
    if facet.surface in UPRIGHT and abs(facet.normal[2]) < 1e-6:
        right = np.array([right[0], right[1], 0.0])
    right = right / np.linalg.norm(right)
    down = np.cross(-facet.normal, right)
    origin = facet.normal * facet.offset_m
    return WallPlane(picture, pitch_m, _tuple(origin), _tuple(right), _tuple(down), facet.look.contrast)


def _tuple(vector: Array) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
