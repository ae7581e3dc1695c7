"""Pictures of a battle from above, drawn with NumPy."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._layout import ScenarioLayout
from ._units import UnitsView
from .errors import PoolError

Picture = NDArray[np.uint8]

GROUND, ROCK = (222, 214, 196), (112, 100, 88)
ALLY, ENEMY = np.array([38, 110, 84]), np.array([186, 62, 48])
SHIELD = (92, 140, 214)


def draw(layout: ScenarioLayout, units: UnitsView, width: int, height: int) -> Picture:
    """A picture, uint8 [height, width, 3], with north at the top.

    Allies are green, enemies red, and paler the less health they have. Units with a shield left have a blue
    rim. The dead are not drawn.
    """
    squares_wide, squares_high = layout.map_size.tolist()
    scale = min(width / squares_wide, height / squares_high)
    x = (np.arange(width) + 0.5 - width / 2) / scale + squares_wide / 2
    y = (height / 2 - np.arange(height) - 0.5) / scale + squares_high / 2
    picture = np.zeros((height, width, 3), np.uint8)
    _draw_ground(picture, layout, x, y)
    stats = layout.allies + layout.enemies
    for index in np.flatnonzero(units.health > 0):
        colour = ALLY if index < layout.n_agents else ENEMY
        health = units.health[index] / units.health_max[index]
        paled = colour * health + 235 * (1 - health)
        rim = SHIELD if units.shield[index] > 0 else colour
        _draw_disc(picture, units.positions[index], stats[index]["radius"], paled, rim, x, y)
    return picture


def _draw_ground(
    picture: Picture, layout: ScenarioLayout, x: NDArray[np.float64], y: NDArray[np.float64]
) -> None:
    rows, columns = np.floor(y).astype(int), np.floor(x).astype(int)
    on_rows = np.flatnonzero((rows >= 0) & (rows < layout.walkable.shape[0]))
    on_columns = np.flatnonzero((columns >= 0) & (columns < layout.walkable.shape[1]))
    walkable = layout.walkable[rows[on_rows]][:, columns[on_columns]]
    colours = np.array([ROCK, GROUND], np.uint8)
    picture[np.ix_(on_rows, on_columns)] = colours[walkable.astype(int)]


def _draw_disc(
    picture: Picture,
    centre: NDArray[np.float32],
    radius: float,
    fill: Any,
    rim: Any,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> None:
    columns, rows = np.flatnonzero(abs(x - centre[0]) <= radius), np.flatnonzero(abs(y - centre[1]) <= radius)
    away = np.hypot(x[columns] - centre[0], (y[rows] - centre[1])[:, None])
    part = picture[np.ix_(rows, columns)]
    part[away <= radius] = rim
    part[away <= radius * 0.8] = np.asarray(fill, np.uint8)
    picture[np.ix_(rows, columns)] = part


class Window:
    """A window that shows pictures. Raises PoolError if pygame is not installed."""

    def __init__(self, title: str, width: int, height: int) -> None:
        try:
            pygame: Any = importlib.import_module("pygame")
        except ImportError as error:
            raise PoolError('a window needs pygame (pip install pygame); "rgb_array" does not') from error
        self._pygame = pygame
        pygame.display.init()
        self._screen: Any = pygame.display.set_mode((width, height))
        pygame.display.set_caption(title)

    def show(self, picture: Picture) -> bool:
        """Show a picture, and return whether the window is still open."""
        quits = self._pygame.event.get(self._pygame.QUIT)
        self._pygame.surfarray.blit_array(self._screen, picture.swapaxes(0, 1))
        self._pygame.display.flip()
        return not quits

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()
