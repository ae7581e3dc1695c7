"""Pictures: the native renderer, `Envs.render`, and the window of render mode "human"."""

from __future__ import annotations

import json
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import smaclite_pool as sp
from numpy.typing import NDArray
from smaclite_pool._render import BattleViewer, Window

from conftest import Serve, each_case
from play import battle_of, duel

Picture = NDArray[np.uint8]


def write_duel(folder: Path, name: str = "duel") -> Path:
    path = folder / f"{name}.json"
    path.write_text(json.dumps(duel(name=name)))
    return path


def is_picture(picture: Picture, width: int, height: int) -> bool:
    return picture.shape == (height, width, 3) and picture.dtype == np.uint8 and len(np.unique(picture)) > 8


def test_pictures_differ_between_states() -> None:
    renderer = sp.Renderer("terran_5_vs_5", 200, 120)
    with sp.make("terran_5_vs_5", 1, seed=0) as envs:
        first = envs.reset(seed=1).state[0].copy()
        last = envs.step(envs.sample_actions()).state[0].copy()
    assert renderer.state_size == len(first)
    picture = renderer.render(first)
    assert is_picture(picture, 200, 120) and picture.flags.writeable
    assert np.array_equal(picture, renderer.render(first.astype(np.float64)))
    assert not np.array_equal(picture, renderer.render(last))
    assert not np.array_equal(picture, renderer.render(np.zeros_like(first)))  # all are dead


def test_units_have_the_sizes_of_their_rules() -> None:
    """A spine crawler is wider than a stalker under `starcraft`, and was drawn as SMAClite's."""
    with sp.make("2s_vs_1sc", 1, rules="starcraft") as envs, sp.make("2s_vs_1sc", 1) as others:
        state = envs.reset(seed=1).state[0].copy()
        own, by_name, of_others = (sp.Renderer(who, 200, 120) for who in (envs, "2s_vs_1sc", others))
        assert np.array_equal(by_name.render(state), of_others.render(state))
        assert not np.array_equal(own.render(state), of_others.render(state))


def test_options_change_the_picture() -> None:
    with sp.make("MMM", 1) as envs:
        state = envs.reset(seed=1).state[0].copy()
    plain = sp.Renderer("MMM").render(state)
    assert is_picture(plain, 512, 512)
    options: list[dict[str, Any]] = [{"theme": "light"}]
    options += [{name: True} for name in ("show_sight", "show_range", "show_ids")]
    pictures = [sp.Renderer("MMM", **option).render(state) for option in options]
    assert len({picture.tobytes() for picture in [plain, *pictures]}) == 5


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e30, 1e30])
def test_extreme_states_are_drawn(value: float) -> None:
    renderer = sp.Renderer("2s3z", 64, 64, show_sight=True, show_range=True, show_ids=True)
    state = np.ones(renderer.state_size, np.float32)
    state[1::2] = value
    assert renderer.render(state).shape == (64, 64, 3)


def test_a_sheet_contains_every_picture() -> None:
    renderer = sp.Renderer("2s3z", 64, 48)
    with sp.make("2s3z", 5) as envs:
        envs.reset(seed=1)
        states = envs.step(envs.sample_actions()).state.copy()
    sheet = renderer.sheet(states)
    assert sheet.dtype == np.uint8
    for state in states:
        assert all(row.tobytes() in sheet.tobytes() for row in renderer.render(state))
    assert np.array_equal(sheet, renderer.sheet(states, [0, 1, 2, 3, 4], 3))
    assert not np.array_equal(sheet, renderer.sheet(states, [0, 1, 2, 3, 9]))
    column, row = renderer.sheet(states, columns=1), renderer.sheet(states, columns=99)
    assert column.shape[0] > 5 * 48 and row.shape[1] > 5 * 64


def test_a_sheet_has_a_caption_per_picture() -> None:
    renderer = sp.Renderer("3m", 64, 48)
    with sp.make("3m", 3) as envs:
        batch = envs.reset(seed=1)
        plain = renderer.sheet(batch.state)
        assert np.array_equal(plain, renderer.sheet(batch.state, captions=["0", "1", "2"]))
        named = renderer.sheet(batch.state, captions=["won", "lost", "lost"])
        assert not np.array_equal(plain, named) and plain.shape == named.shape
        assert np.array_equal(named, envs.render(batch, None, renderer, captions=["won", "lost", "lost"]))
        some = envs.render(batch, [2, 0], renderer, captions=["a", "b"])
        assert np.array_equal(some, renderer.sheet(batch.state[[2, 0]], captions=["a", "b"]))
        with pytest.raises(
            sp.errors.InvalidRequest, match="captions must have one string per picture, 3, got 2"
        ):
            envs.render(batch, captions=["a", "b"])
        expected = r"captions must be a list of strings, such as \[\"first\"\], got int"
        with pytest.raises(TypeError, match=expected):
            envs.render(batch, captions=1)  # type: ignore[arg-type]
        for of_sheets in ({"captions": ["a"]}, {"columns": 2}):
            with pytest.raises(sp.errors.InvalidRequest, match="are for sheets of several pictures"):
                envs.render(batch, 0, **of_sheets)


def test_without_a_batch_the_newest_one_is_drawn() -> None:
    renderer = sp.Renderer("3m", 64, 48)
    with sp.make("3m", 2) as envs:
        with pytest.raises(sp.errors.InvalidRequest, match="there is no batch to draw"):
            envs.render(env_id=1)
        first = envs.reset(seed=1)
        assert np.array_equal(envs.render(env_id=1, renderer=renderer), renderer.render(first.state[1]))
        state = envs.step(envs.sample_actions()).state  # holds the batch's memory
        assert np.array_equal(envs.render(env_id=1, renderer=renderer), renderer.render(state[1]))
        assert not np.array_equal(state[1], first.state[1])
        drawn = renderer.render(state[1])
        del state, first
        assert np.array_equal(envs.render(env_id=1, renderer=renderer), drawn)


WRONG: dict[type[Exception], list[tuple[Callable[[Any, Any], object], str]]] = {
    sp.errors.InvalidRequest: [
        (lambda r, s: sp.Renderer("2s3z", 15), "between 16 and 4096 pixels, got 15 x 512"),
        (lambda r, s: sp.Renderer("2s3z", height=-1), "height must not be negative, got -1"),
        (
            lambda r, s: sp.Renderer("2s3z", theme="blue"),  # type: ignore[arg-type]
            'must be "dark" or "light", got `blue`',
        ),
        (lambda r, s: r.render(s[0, :3]), r"state must be a float32 array of shape \(\d+,\), got \(3,\)"),
        (lambda r, s: r.sheet(s[0]), r"states must be .* of shape \(K, (\d+)\), got \(\1,\)"),
        (lambda r, s: r.sheet(s[:0]), "states must have at least one row, got none"),
        (lambda r, s: r.sheet(s, [1, 2, 3]), "env_id must have one number per row of states, 2, got 3"),
        (lambda r, s: r.sheet(s, columns=0), "columns must be at least 1, or None, got 0"),
        (
            lambda r, s: r.sheet(np.broadcast_to(s[0], (300_000, s.shape[1]))),
            "a sheet of 300000 pictures is too large.*16384",
        ),
    ],
    TypeError: [
        (
            lambda r, s: sp.Renderer("2s3z", "512"),  # type: ignore[arg-type]
            "width must be an integer, got str",
        ),
        (lambda r, s: r.render(s[0].astype(np.int64)), "state must be a float32 array, got int64"),
    ],
    sp.errors.ScenarioError: [(lambda r, s: sp.Renderer("no_such"), "no_such")],
}


@pytest.mark.parametrize(("error", "call", "match"), each_case(WRONG))
def test_errors_say_what_is_accepted(error: type[Exception], call: Any, match: str) -> None:
    renderer = sp.Renderer("2s3z", 64, 64)
    with pytest.raises(error, match=match):
        call(renderer, np.zeros((2, renderer.state_size), np.float32))


def test_a_pool_draws_the_environments_of_a_batch() -> None:
    renderer = sp.Renderer("3m", 96, 96)
    with sp.make("3m", 4, seed=0) as envs:
        envs.reset(seed=3)
        batch = envs.step(envs.sample_actions())
        picture = envs.render(batch, 2, renderer)
        assert np.array_equal(picture, renderer.render(batch.state[2]))
        assert not np.array_equal(picture, envs.render(batch, 1, renderer))
        assert np.array_equal(envs.render(batch, np.int32(2)), sp.Renderer("3m").render(batch.state[2]))
        sheet = envs.render(batch, renderer=renderer, columns=4)
        assert np.array_equal(sheet, renderer.sheet(batch.state, batch.env_id, 4))
        some = envs.render(batch, [3, 1], renderer)
        assert np.array_equal(some, renderer.sheet(batch.state[[3, 1]], [3, 1]))
        assert np.array_equal(envs.render(batch), sp.Renderer("3m", 256, 256).sheet(batch.state))
        for env in (4, 2**40):
            with pytest.raises(sp.errors.InvalidRequest, match="env_id must be"):
                envs.render(batch, env)
        with pytest.raises(sp.errors.InvalidRequest, match="env_id must be between 0 and 3, got 7"):
            envs.render(batch, [0, 7])
        with pytest.raises(sp.errors.InvalidRequest, match="env_id must not be negative, got -1"):
            envs.render(batch, -1)
        with pytest.raises(sp.errors.InvalidRequest, match="at least one environment"):
            envs.render(batch, [])
        with pytest.raises(sp.errors.InvalidRequest, match="must have .*, as in `2s3z` of the renderer, got"):
            envs.render(batch, 0, sp.Renderer("2s3z"))


def test_a_lane_without_states_has_no_pictures() -> None:
    with sp.make("3m", 1, fields=["obs"]) as envs:
        batch = envs.reset()
        with pytest.raises(AttributeError, match="do not include `state`; add it to `fields`"):
            envs.render(batch, 0)


def test_an_environment_must_be_in_the_batch() -> None:
    with sp.make("3m", 4, batch_size=2) as envs:
        envs.async_reset(seed=1)
        batch = envs.recv()
        present = batch.env_id.tolist()
        absent = next(env for env in range(4) if env not in present)
        assert is_picture(envs.render(batch, present[1]), 512, 512)
        with pytest.raises(sp.errors.InvalidRequest, match=f"environment {absent} is not in this batch"):
            envs.render(batch, absent)


def test_an_attached_learner_draws_custom_scenarios(tmp_path: Path, serve: Serve) -> None:
    own, misnamed = write_duel(tmp_path), write_duel(tmp_path, "3m")
    serve("3m:2", f"own={own}:2", f"misnamed={misnamed}:2", "--name", "seen")
    with sp.connect("seen", "3m") as envs:
        assert is_picture(envs.render(envs.reset(), 1), 512, 512)
    for lane in ("own", "misnamed"):
        with sp.connect("seen", lane) as envs:
            batch, renderer = envs.reset(), sp.Renderer(envs)
            assert np.array_equal(envs.render(batch, 1), renderer.render(batch.state[1]))
            assert np.array_equal(envs.render(batch, 1, sp.Renderer(own)), renderer.render(batch.state[1]))


def test_a_pool_in_this_process_draws_its_custom_scenario(tmp_path: Path) -> None:
    path = write_duel(tmp_path)
    with sp.make(path, 1) as envs:
        path.unlink()
        assert is_picture(envs.render(envs.reset(), 0), 512, 512)


def all_stop(adapter: str, env: Any) -> None:
    if adapter in ("raw_env", "env"):  # agent by agent
        for _ in env.agents:
            env.step(1)
    else:
        env.step([1] * 3 if adapter == "gymnasium" else dict.fromkeys(env.agents, 1))


adapters = pytest.mark.parametrize("adapter", ["gymnasium", "parallel_env", "raw_env", "env", "rllib"])


@adapters
def test_an_environment_draws_the_units_of_its_options(adapter: str) -> None:
    """Those of the scenario were drawn, or the state had the wrong size for them."""
    drawn: dict[str, Any] = {
        "teams": {"distribution": "all_teams", "unit_types": ["MARINE", "MARAUDER", "MEDIVAC"]},
        "start_positions": {"distribution": "reflect_position"},
    }
    env = battle_of(adapter, "3m", seed=1, render_mode="rgb_array", **drawn)
    env.reset(seed=1)
    with sp.make("3m", 1, **drawn) as envs:
        expected = sp.Renderer(envs, 640, 640).render(envs.reset(seed=1).state[0])
    assert np.array_equal(env.render(), expected)
    env.close()


@adapters
def test_a_window_shows_every_step_of_an_environment(adapter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Picture] = []
    monkeypatch.setattr(Window, "show", lambda _, picture: shown.append(picture))
    env = battle_of(adapter, "3m", render_mode="human", render_speed=0.5)
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    env.reset(seed=1)
    all_stop(adapter, env)
    assert env.render() is None and len(shown) == 3
    assert np.array_equal(shown[1], shown[2]) and not np.array_equal(shown[0], shown[1])
    env.close()
    plain = battle_of(adapter, "3m", render_mode=None)
    plain.reset()
    assert plain.render() is None and len(shown) == 3
    plain.close()


@adapters
def test_an_environment_refuses_other_modes_and_speeds(adapter: str) -> None:
    for option, value in {"render_mode": "ansi", "render_speed": 0}.items():
        with pytest.raises(sp.errors.InvalidRequest, match=f"{option} must be"):
            battle_of(adapter, "3m", **{option: value})


class FakePygame(types.ModuleType):
    """The part of pygame that a window uses; it records what is shown."""

    QUIT = 256
    error = RuntimeError

    def __init__(self, driver: str = "x11") -> None:
        super().__init__("pygame")
        self.calls: list[Any] = []
        self.shown: list[Picture] = []
        self.quits: list[Any] = []
        self.display = types.SimpleNamespace(
            init=lambda: self.calls.append("init"),
            get_driver=lambda: driver,
            set_mode=self._set_mode,
            set_caption=self.calls.append,
            flip=lambda: None,
            quit=lambda: self.calls.append("quit"),
        )
        self.event = types.SimpleNamespace(get=lambda _: self.quits)
        self.surfarray = types.SimpleNamespace(blit_array=self._blit)

    def _set_mode(self, size: tuple[int, int]) -> object:
        self.calls.append(size)
        return object()

    def _blit(self, _: object, columns: Picture) -> None:
        self.shown.append(columns.swapaxes(0, 1))


def a_state() -> NDArray[np.float32]:
    with sp.make("3m", 1) as envs:
        state: NDArray[np.float32] = envs.reset(seed=1).state[0].copy()
        return state


def test_a_window_shows_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame, state = FakePygame(), a_state()
    monkeypatch.setitem(sys.modules, "pygame", pygame)
    viewer = BattleViewer("3m", 80, 60, speed=None)
    viewer.close()
    assert pygame.calls == []
    assert viewer.show(state) and np.array_equal(pygame.shown[0], viewer.picture(state))
    assert pygame.calls == ["init", (80, 60), "smaclite_pool: 3m"]
    pygame.quits = ["event"]
    assert not viewer.show(state)
    viewer.close()
    viewer.close()
    assert pygame.calls[3:] == ["quit"]


@pytest.mark.parametrize(("speed", "seconds"), [(1, 0.5), (0.25, 2.0), (4.0, 0.125), (None, 0.0)])
def test_a_window_shows_each_picture_for_a_step(
    monkeypatch: pytest.MonkeyPatch, speed: float | None, seconds: float
) -> None:
    pygame, state, now = FakePygame(), a_state(), 100.0

    def sleep(duration: float) -> None:
        nonlocal now
        now += duration

    monkeypatch.setitem(sys.modules, "pygame", pygame)
    clock = types.SimpleNamespace(monotonic=lambda: now, sleep=sleep)
    monkeypatch.setattr("smaclite_pool._render.time", clock)
    viewer = BattleViewer("3m", 80, 60, speed=speed)
    viewer.show(state)
    assert now == 100.0, "the first picture is shown at once"
    for count in (1, 2):
        viewer.show(state)
        assert now == pytest.approx(100 + count * seconds)
    now += 10  # a slow learner is not made slower
    viewer.show(state)
    assert now == pytest.approx(110 + 2 * seconds)
    pygame.quits = ["event"]
    assert not viewer.show(state) and now == pytest.approx(110 + 2 * seconds), "a closed window does not wait"


@pytest.mark.parametrize("speed", [0, -1.0, float("nan"), float("inf"), "slow"])
def test_a_wrong_speed_is_refused(speed: Any) -> None:
    with pytest.raises(sp.errors.InvalidRequest, match="render_speed must be a number above 0, or None"):
        BattleViewer("3m", 80, 60, speed=speed)


def test_a_window_without_a_display_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL would draw into memory that is never shown, unless the user asked for it."""
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
    pygame = FakePygame("offscreen")
    monkeypatch.setitem(sys.modules, "pygame", pygame)
    state = a_state()
    for _ in range(2):
        with pytest.raises(sp.errors.PoolError, match='needs a display, .* use render_mode="rgb_array"'):
            BattleViewer("3m", 80, 60).show(state)
    assert pygame.calls == ["init", "quit"] * 2
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert BattleViewer("3m", 80, 60).show(state)

    def fail() -> None:
        raise RuntimeError("x11 not available")

    pygame.display.init = fail
    with pytest.raises(sp.errors.PoolError, match=r"needs a display.*\(x11 not available\)"):
        BattleViewer("3m", 80, 60).show(state)


def test_a_window_without_pygame_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    viewer = BattleViewer("3m", 80, 60)
    with pytest.raises(sp.errors.PoolError, match="pip install pygame"):
        viewer.show(np.zeros(sp.Renderer("3m").state_size, np.float32))
