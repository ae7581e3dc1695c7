// BattlePlayer: shows a track, with clock and controls. Pages say which tracks there are.

const RESULTS = { won: "Won", lost: "Lost", truncated: "Time limit", unfinished: "Unfinished" };

const byId = (id) => document.getElementById(id);

class BattlePlayer {
  constructor(info) {
    this.clock = new Clock();
    this.timeline = new Timeline(byId("marks"), byId("scrub"), (tick) => this.seek(tick));
    this.chart = new HealthChart(byId("chart"), (tick) => this.seek(tick));
    this.use(info);
  }

  /** Shows battles of a scenario from now on. */
  use(info) {
    this.info = info;
    this.view = new BattleView(byId("battle"), info);
    this.inspector = new Inspector(info, (unit) => this.select(unit));
    this.chart.track = this.view.track;
    this.redraw();
    for (const kind of ["shield", "energy"])
      byId("legend").querySelector(`.${kind}`).hidden = !info.types.some((type) => type[kind] > 0);
  }

  /** Shows a track from its start. */
  show(track) {
    this.view.track = this.chart.track = track;
    this.view.camera = null;
    this.clock.end = track.last;
    this.clock.seek(0);
    this.redraw();
  }

  seek(tick) {
    this.clock.seek(tick);
    this.redraw();
  }

  toggle() {
    this.clock.toggle();
    this.redraw();
  }

  select(unit) {
    this.view.selected = unit === this.view.selected ? -1 : unit;
    this.redraw();
  }

  /** Selects the next living unit in a direction. */
  selectNext(direction) {
    const { view, clock } = this,
      n = this.info.units.length;
    let unit = view.selected < 0 && direction < 0 ? 0 : view.selected;
    for (let tries = 0; tries < n; tries++) {
      unit = (unit + direction + n) % n;
      if (view.track.unitAt(unit, clock.time).alive) {
        view.selected = unit;
        return this.redraw();
      }
    }
  }

  fit() {
    this.view.wholeMap = !this.view.wholeMap;
    byId("fit").setAttribute("aria-pressed", String(this.view.wholeMap));
    this.view.camera = null;
    this.redraw();
  }

  redraw() {
    this.drawn = "";
  }

  frame(now) {
    const { clock, view } = this;
    clock.advance(now);
    const { track } = view,
      time = clock.time;
    const box = view.canvas.getBoundingClientRect();
    const key = [time, box.width, box.height, devicePixelRatio].join();
    if (key === this.drawn || !track.length) return;
    if (view.width !== undefined && (box.width !== view.width || box.height !== view.height))
      view.camera = null;
    this.drawn = key;
    view.draw(time);
    this.chart.draw(time);
    this.timeline.draw(track, time);
    const tick = Math.floor(time);
    this.inspector.update(track, tick, view.selected);
    this.showControls(track, tick);
  }

  showControls(track, tick) {
    const { clock } = this;
    document.body.classList.toggle("playing", clock.playing);
    byId("play").setAttribute("aria-label", clock.playing ? "Pause" : "Play");
    byId("start").hidden = clock.playing || clock.time > 0;
    byId("speed").textContent = `${clock.speed}\u00d7`;
    const steps = Math.floor(track.last / TICKS_PER_STEP);
    const text = [
      ["step ", `${Math.floor(tick / TICKS_PER_STEP)}`, ` / ${steps}`],
      ["tick ", `${tick}`, ""],
      ["", (tick / TICKS_PER_SECOND).toFixed(1), " s"],
    ];
    byId("time").replaceChildren(
      ...text.flatMap(([before, value, after], i) => [
        i ? " \u00b7 " : "",
        before,
        make("b", {}, value),
        after,
      ]),
    );
  }

  listen() {
    byId("play").addEventListener("click", () => this.toggle());
    byId("start").addEventListener("click", () => this.toggle());
    byId("fit").addEventListener("click", () => this.fit());
    byId("theme").addEventListener("click", () => theme.toggle());
    byId("help").addEventListener("click", () => byId("keys").showModal());
    theme.listeners.push(() => this.redraw());
    const moves = {
      home: () => this.seek(0),
      end: () => this.seek(this.clock.end),
      back: () => this.step(-TICKS_PER_STEP),
      forward: () => this.step(TICKS_PER_STEP),
    };
    document
      .querySelectorAll("[data-go]")
      .forEach((button) => button.addEventListener("click", moves[button.dataset.go]));
    document
      .querySelectorAll("[data-speed]")
      .forEach((button) =>
        button.addEventListener("click", () => this.changeSpeed(Number(button.dataset.speed))),
      );
    addEventListener("keydown", (event) => this.key(event), { capture: true });
    // After a click the space bar plays again; with the keyboard (detail 0) a button keeps the focus.
    addEventListener("click", (event) => event.detail > 0 && event.target.closest?.("button")?.blur());
    this.listenToPointer(byId("battle"));
  }

  step(ticks) {
    this.clock.stepTicks(ticks);
    this.redraw();
  }

  changeSpeed(direction) {
    this.clock.changeSpeed(direction);
    this.redraw();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("keys").open) return;
    const on = event.target instanceof HTMLElement ? event.target.closest("button") : null;
    // A focused button takes the space bar itself.
    if (event.key === " " && on) return;
    const command = this.command(event.key, event.shiftKey ? TICKS_PER_STEP : 1);
    if (!command) return;
    event.preventDefault();
    command();
  }

  /** What a key does. */
  command(key, ticks) {
    return {
      " ": () => this.toggle(),
      ArrowLeft: () => this.step(-ticks),
      ArrowRight: () => this.step(ticks),
      "+": () => this.changeSpeed(1),
      "=": () => this.changeSpeed(1),
      "-": () => this.changeSpeed(-1),
      Home: () => this.seek(0),
      End: () => this.seek(this.clock.end),
      Escape: () => this.select(-1),
      "[": () => this.selectNext(-1),
      "]": () => this.selectNext(1),
      m: () => this.fit(),
      t: () => theme.toggle(),
      "?": () => byId("keys").showModal(),
    }[key];
  }

  listenToPointer(canvas) {
    const local = (event) => {
      const { left, top } = canvas.getBoundingClientRect();
      return [event.clientX - left, event.clientY - top];
    };
    let from = null,
      moved = false;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      [from, moved] = [local(event), false];
    });
    canvas.addEventListener("pointermove", (event) => {
      const at = local(event);
      if (!from) {
        const unit = this.view.unitAt(...at);
        if (unit !== this.view.hovered) this.redraw();
        this.view.hovered = unit;
        canvas.classList.toggle("over", unit >= 0);
        return;
      }
      const [dx, dy] = [at[0] - from[0], at[1] - from[1]];
      if (!moved && Math.hypot(dx, dy) < 4) return;
      moved = true;
      canvas.classList.add("moving");
      this.view.move(dx, dy);
      from = at;
      this.redraw();
    });
    const release = (event) => {
      if (event.type === "pointerup" && from && !moved) {
        const unit = this.view.unitAt(...local(event));
        if (unit >= 0 || this.view.selected >= 0) this.select(unit);
      }
      from = null;
      canvas.classList.remove("moving");
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => {
      this.view.hovered = -1;
      this.redraw();
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.view.zoom(Math.exp(-event.deltaY * 0.0015), ...local(event));
        this.redraw();
      },
      { passive: false },
    );
    canvas.addEventListener("dblclick", () => {
      this.view.camera = null;
      this.redraw();
    });
  }
}
