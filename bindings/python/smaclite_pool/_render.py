"""Render modes of single battles: pictures from the native renderer, and a window that shows them."""

from __future__ import annotations

import importlib
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Renderer
from .errors import InvalidRequest, PoolError

Picture = NDArray[np.uint8]

RENDER_MODES = ("human", "rgb_array")
RENDER_FPS = 2
"""Pictures per second at the speed of the battle: a step is half a second."""


def check_render_mode(mode: str | None) -> None:
    """Raise InvalidRequest unless the mode is None or one of `RENDER_MODES`."""
    if mode is not None and mode not in RENDER_MODES:
        raise InvalidRequest(f'render_mode must be None, "human" or "rgb_array", got {mode!r}')


class Window:
    """A window of the size of its first picture, opened with it. Needs pygame."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._pygame: Any = None
        self._screen: Any = None

    def show(self, picture: Picture) -> bool:
        """Show a picture, and return whether the window is still open.

        Raises PoolError if pygame is not installed.
        """
        if self._screen is None:
            self._open(picture.shape[1], picture.shape[0])
        quits = self._pygame.event.get(self._pygame.QUIT)
        self._pygame.surfarray.blit_array(self._screen, picture.swapaxes(0, 1))
        self._pygame.display.flip()
        return not quits

    def _open(self, width: int, height: int) -> None:
        try:
            self._pygame = importlib.import_module("pygame")
        except ImportError as error:
            raise PoolError('a window needs pygame (pip install pygame); "rgb_array" does not') from error
        self._pygame.display.init()
        self._screen = self._pygame.display.set_mode((width, height))
        self._pygame.display.set_caption(self._title)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._screen is not None:
            self._pygame.display.quit()
            self._screen = None


class BattleViewer:
    """Pictures of one battle, and a window. The renderer and the window are made when first used.

    Args:
        scenario: name of a standard scenario, or path of a scenario file.
        width, height: size of pictures and of the window in pixels, each from 16 to 4096.
    """

    def __init__(self, scenario: str | PathLike[str], width: int, height: int) -> None:
        self._scenario, self._size = scenario, (width, height)
        self._window = Window(f"smaclite_pool: {scenario}")

    @cached_property
    def _renderer(self) -> Renderer:
        return Renderer(self._scenario, *self._size)

    def picture(self, state: NDArray[np.float32]) -> Picture:
        """A picture, uint8 [height, width, 3], of a state, float32 [state_size]."""
        return self._renderer.render(state)

    def show(self, state: NDArray[np.float32]) -> bool:
        """Show a state in the window, and return whether the window is still open."""
        return self._window.show(self.picture(state))

    def close(self) -> None:
        """Close the window, if it is open."""
        self._window.close()
