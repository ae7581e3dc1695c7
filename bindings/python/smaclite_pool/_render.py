"""Render modes: pictures from the native renderer, and a window that shows them."""

from __future__ import annotations

import importlib
import math
import os
import time
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Batch, Envs, Renderer
from .errors import InvalidRequest, PoolError

Picture = NDArray[np.uint8]

RENDER_MODES = ("human", "rgb_array")
RENDER_FPS = 2
"""Pictures per second at the speed of the battle: a step is half a second."""


def check_rendering(mode: str | None, speed: float | None = 1.0) -> None:
    """Raise InvalidRequest for a mode that is not None or one of `RENDER_MODES`, and for a speed that is not
    None or a finite number above 0."""
    if mode is not None and mode not in RENDER_MODES:
        raise InvalidRequest(f'render_mode must be None, "human" or "rgb_array", got {mode!r}')
    if speed is not None and not (isinstance(speed, int | float) and 0 < speed < math.inf):
        raise InvalidRequest(f"render_speed must be a number above 0, or None for no waiting, got {speed!r}")


class Window:
    """A window of the size of its first picture, opened with it. Needs pygame and a display.

    Args:
        title: its title.
        speed: 1 shows each picture for as long as a step of the battle, half a second; 0.25 is slow motion,
            and None does not wait.
    """

    def __init__(self, title: str, speed: float | None = 1.0) -> None:
        check_rendering(None, speed)
        self._title = title
        self._seconds = 0.0 if speed is None else 1 / (RENDER_FPS * speed)
        self._shown = -math.inf
        self._pygame: Any = None
        self._screen: Any = None

    def show(self, picture: Picture) -> bool:
        """Show a picture, and return whether the window is still open.

        Waits until the last picture was shown for long enough. Raises PoolError if pygame is not installed or
        there is no display.
        """
        if self._screen is None:
            self._open(picture.shape[1], picture.shape[0])
        quits = self._wait()
        self._pygame.surfarray.blit_array(self._screen, picture.swapaxes(0, 1))
        self._pygame.display.flip()
        self._shown = time.monotonic()
        return not quits

    def _wait(self) -> bool:
        """Wait in slices, between which the window reacts; return whether the user closed it."""
        quits = bool(self._pygame.event.get(self._pygame.QUIT))
        while not quits and (left := self._shown + self._seconds - time.monotonic()) > 0:
            time.sleep(min(left, 0.02))
            quits = bool(self._pygame.event.get(self._pygame.QUIT))
        return quits

    def _open(self, width: int, height: int) -> None:
        try:
            self._pygame = importlib.import_module("pygame")
        except ImportError as error:
            raise PoolError('a window needs pygame (pip install pygame); "rgb_array" does not') from error
        display = self._pygame.display
        no_display = 'a window needs a display, and there is none; use render_mode="rgb_array"'
        try:
            display.init()
            # Without a display, SDL may draw into memory that is never shown. The variable asks for that.
            if display.get_driver() in ("offscreen", "dummy") and "SDL_VIDEODRIVER" not in os.environ:
                display.quit()
                raise PoolError(no_display)
            self._screen = display.set_mode((width, height))
        except self._pygame.error as error:
            raise PoolError(f"{no_display} ({error})") from error
        display.set_caption(self._title)

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._screen is not None:
            self._pygame.display.quit()
            self._screen = None


class BattleViewer:
    """Pictures of one battle, and a window. The renderer and the window are made when first used.

    Args:
        of: the environments, whose options can make units others than the scenario's; or the name of a
            standard scenario.
        width, height: size of pictures and of the window in pixels, each from 16 to 4096.
        mode: None or one of `RENDER_MODES`.
        speed: of the window, as in `Window`.

    Raises InvalidRequest for another mode or speed.
    """

    def __init__(
        self,
        of: Envs | str,
        width: int,
        height: int,
        mode: str | None = None,
        speed: float | None = 1.0,
    ) -> None:
        check_rendering(mode)
        self._of, self._size, self._mode = of, (width, height), mode
        self._window = Window(f"smaclite_pool: {of if isinstance(of, str) else of.spec.scenario}", speed)

    @cached_property
    def _renderer(self) -> Renderer:
        return Renderer(self._of, *self._size)

    def picture(self, state: NDArray[np.float32]) -> Picture:
        """A picture, uint8 [height, width, 3], of a state, float32 [state_size]."""
        return self._renderer.render(state)

    def show(self, state: NDArray[np.float32]) -> bool:
        """Show a state in the window, and return whether the window is still open."""
        return self._window.show(self.picture(state))

    def render(self, state: NDArray[np.float32]) -> Picture | None:
        """What `render()` of an environment does in its mode."""
        if self._mode == "rgb_array":
            return self.picture(state)
        self.observe(state)
        return None

    def observe(self, state: NDArray[np.float32]) -> None:
        """Take in the state after a reset or step: with "human", show it."""
        if self._mode == "human":
            self.show(state)

    def close(self) -> None:
        """Close the window, if it is open."""
        self._window.close()


class LaneViewer:
    """Pictures of all environments of a lane, and a window with all of them.

    With a mode it holds the newest batch. Arguments as in `BattleViewer`.

    Raises InvalidRequest for another mode or speed, and with a mode if the lane omits the field `state`.
    """

    picture_size = (256, 256)

    def __init__(
        self, envs: Envs, mode: str | None, speed: float | None = 1.0, renderer: Renderer | None = None
    ) -> None:
        check_rendering(mode)
        self._mode = mode
        self._window = Window(f"smaclite_pool: {envs.spec.scenario}", speed)
        self._batch: Batch | None = None
        if mode is not None:
            if "state" not in envs.spec.fields:
                raise InvalidRequest("pictures are drawn from the field `state`, which this lane omits")
            self._renderer = renderer or Renderer(envs, *self.picture_size)

    def observe(self, batch: Batch) -> None:
        """Take in the batch after a reset or step: with "human", show it."""
        if self._mode is not None:
            self._batch = batch
        if self._mode == "human":
            self.render()

    def render(self) -> list[Picture] | None:
        """A picture per environment with "rgb_array", or all of them in the window with "human".

        Raises InvalidRequest before the first reset.
        """
        if self._mode is None:
            return None
        if self._batch is None:
            raise InvalidRequest("no battle has begun; call reset first")
        if self._mode == "rgb_array":
            return [self._renderer.render(state) for state in self._batch.state]
        self._window.show(self._renderer.sheet(self._batch.state))
        return None

    def close(self) -> None:
        """Release the batch, and close the window, if it is open."""
        self._batch = None
        self._window.close()
