"use strict";
/* The page: one view of all runs, its controls, and its panels. */

const COLORS = ["density", "agent", "outcome", "episode", "return", "difference"];
/** Maximum number of agents with a chip. */
const MAX_CHIPS = 64;
/** Milliseconds between two pictures while playing, and number of pictures for all episodes. */
const PLAY_INTERVAL = 80;
const PLAY_STEPS = 100;

class App {
  constructor(data, runs) {
    Object.assign(this, { axes: data.axes, palette: data.palette, isEmbedded: data.is_embedded, runs });
    this.agentCount = Math.max(...runs.map((run) => run.agents));
    const numbers = runs.map((run) => run.episodes.episode).filter((episodes) => episodes.length);
    const first = Math.min(...numbers.map((episodes) => episodes.reduce((one, other) => Math.min(one, other))), Infinity);
    const last = Math.max(...numbers.map((episodes) => episodes.reduce((one, other) => Math.max(one, other))), 0);
    const returns = this.axes.find((axis) => axis.kind === "return");
    this.view = { first: Number.isFinite(first) ? first : 0, last, returns: [returns.low, returns.high] };
    this.open(location.hash.slice(1));
    this.isDark = !this.isEmbedded && matchMedia("(prefers-color-scheme: dark)").matches;
    this.panels = runs.map((run) => new Panel(run, this));
    byId("runs").replaceChildren(...this.panels.map((panel) => panel.element));
    this.ranges = new Ranges(this);
    this.makeControls();
    showHint(this);
    this.draw();
  }

  /** Axes that are shown at first. */
  shownAxes() {
    const shown = this.axes.flatMap((axis, a) => (axis.shown ? [a] : []));
    return shown.length > 1 ? shown : this.axes.map((_, a) => a);
  }

  /** Axes of the scatter plot at first: the coordinates of the task, or the first two observations. */
  firstPair() {
    const [x, y] = ["x [m]", "y [m]"].map((title) => this.axes.findIndex((axis) => axisTitle(axis) === title));
    if (x >= 0 && y >= 0) return [x, y];
    return this.axes.length > 1 ? [0, 1] : [0, 0];
  }

  /** What states can be colored by. */
  colors() {
    return COLORS.filter((name) => name !== "outcome" || this.runs.every((run) => run.has_outcomes));
  }

  /* ---- changes of the view ---- */

  setBrush(a, brush) {
    this.view.brushes[a] = brush && withoutFull(brush);
    this.redraw();
  }

  change(changes) {
    Object.assign(this.view, changes);
    this.redraw();
  }

  /** Changes the view to that of a hash, unless the page is part of another. Says which parts of it are not understood. */
  open(hash) {
    const ignored = fromHash(this, this.isEmbedded ? "" : hash);
    byId("ignored").hidden = !ignored.length;
    byId("ignored").textContent = `These parts of the address mean nothing here: ${ignored.join(" · ")}`;
  }

  reset() {
    this.open("");
    this.ranges.opened.clear();
    this.redraw();
  }

  /** Draws before the next picture of the screen, once for all changes until then. */
  redraw() {
    this.waiting ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    cancelAnimationFrame(this.waiting);
    this.waiting = null;
    this.theme = themeColors(this.palette, this.isDark);
    document.documentElement.dataset.theme = this.isDark ? "dark" : "light";
    if (this.view.brushes.some(Boolean)) this.hint?.remove();
    for (const panel of this.panels) panel.draw();
    this.updateControls();
    clearTimeout(this.linking);
    this.linking = setTimeout(() => this.updateAddress(), 200);
  }

  updateAddress() {
    if (this.isEmbedded) return;
    const hash = toHash(this);
    if (hash !== location.hash.slice(1)) history.replaceState(null, "", hash ? `#${hash}` : location.pathname + location.search);
  }

  /* ---- controls ---- */

  makeControls() {
    byId("color").replaceChildren(...this.colors().map((name) => new Option(COLOR_TITLES[name], name)));
    byId("compared").replaceChildren(...Array.from({ length: this.agentCount }, (_, agent) => new Option(`agent ${agent}`, agent)));
    byId("color").onchange = (event) => {
      const { agents, compared } = this.view;
      /* A hidden agent is not compared, unless it is chosen. */
      const shown = agents && agents.size && !agents.has(compared) ? Math.min(...agents) : compared;
      this.change({ color: event.target.value, compared: shown });
    };
    byId("compared").onchange = (event) => this.change({ compared: Number(event.target.value) });
    byId("clear").onclick = () => this.reset();
    byId("theme").onclick = () => {
      this.isDark = !this.isDark;
      this.redraw();
    };
    this.makeChips();
    this.makeAxesMenu();
    this.makeSlider();
    makeMenus();
    byId("copy-link").hidden = byId("copy-command").hidden = this.isEmbedded;
    byId("copy-link").onclick = () => {
      this.updateAddress();
      copy(location.href);
    };
    byId("copy-command").onclick = () => copy(toCommand(this));
    byId("save-png").onclick = async () => download(await toPng(this), "states.png");
    byId("save-svg").onclick = () => download(new Blob([toSvg(this)], { type: "image/svg+xml" }), "states.svg");
    addEventListener("hashchange", () => {
      if (this.isEmbedded) return;
      this.open(location.hash.slice(1));
      this.redraw();
    });
  }

  makeChips() {
    const all = () => new Set(Array.from({ length: this.agentCount }, (_, agent) => agent));
    const setAgents = (agents) => this.change({ agents: agents.size === this.agentCount ? null : agents });
    const chip = (_, agent) => {
      const button = document.createElement("button");
      button.className = "chip";
      button.title = "click: show or hide; double click or Shift: only this agent";
      button.onclick = (event) => {
        const agents = this.view.agents ? new Set(this.view.agents) : all();
        if (event.shiftKey) return setAgents(new Set([agent]));
        if (!agents.delete(agent)) agents.add(agent);
        return setAgents(agents);
      };
      button.ondblclick = () => setAgents(new Set([agent]));
      return button;
    };
    this.chips = Array.from({ length: Math.min(this.agentCount, MAX_CHIPS) }, chip);
    byId("chips").replaceChildren(...this.chips);
    byId("all-agents").onclick = () => setAgents(all());
    byId("agent-list").onchange = (event) => {
      const agents = parseList(event.target.value, this.agentCount);
      event.target.setCustomValidity(agents ? "" : "expected numbers and ranges, such as 0-3,7");
      event.target.reportValidity();
      if (agents) setAgents(agents.size ? agents : all());
    };
  }

  makeAxesMenu() {
    const box = (axis, a) => {
      const label = document.createElement("label");
      const input = Object.assign(document.createElement("input"), { type: "checkbox", checked: this.view.axes.includes(a) });
      input.onchange = () => {
        const axes = this.axes.map((_, other) => other).filter((other) => (other === a ? input.checked : this.view.axes.includes(other)));
        if (axes.length > 1) this.change({ axes });
        else input.checked = true;
      };
      label.append(input, ` ${axisTitle(axis)}`);
      return label;
    };
    this.axisBoxes = this.axes.map(box);
    byId("axes").replaceChildren(...this.axisBoxes);
    this.axesSummary = byId("axes").previousElementSibling;
  }

  makeSlider() {
    const { first, last } = this.view;
    const [from, to] = ["from", "to"].map(byId);
    for (const input of [from, to]) Object.assign(input, { min: first, max: last, step: 1 });
    from.oninput = () => this.change({ from: Math.min(Number(from.value), this.view.to) });
    to.oninput = () => this.change({ to: Math.max(Number(to.value), this.view.from) });
    byId("play").onclick = () => (this.playing ? this.stop() : this.play());
  }

  /** Moves the upper end of the episodes to the last one; a window that does not begin at the first episode
      is moved as a whole. */
  play() {
    const { first, last } = this.view;
    const width = this.view.from > first ? this.view.to - this.view.from : null;
    const step = Math.max(1, Math.round((last - first) / PLAY_STEPS));
    if (this.view.to >= last) this.change({ from: first, to: first + (width ?? 0) });
    this.playing = setInterval(() => {
      const to = Math.min(this.view.to + step, last);
      this.change({ to, from: width === null ? first : to - width });
      if (to >= last) this.stop();
    }, PLAY_INTERVAL);
    this.updateControls();
  }

  stop() {
    clearInterval(this.playing);
    this.playing = null;
    this.updateControls();
  }

  updateControls() {
    const { view } = this;
    byId("color").value = view.color;
    byId("compared").value = view.compared;
    byId("comparison").hidden = view.color !== "difference";
    byId("theme").textContent = this.isDark ? "Light" : "Dark";
    byId("play").textContent = this.playing ? "Pause" : "Play";
    [byId("from").value, byId("to").value] = [view.from, view.to];
    byId("episode-range").textContent = `${view.from} to ${view.to}` + (view.from > view.first || view.to < view.last ? ` (of ${view.first} to ${view.last})` : "");
    this.axisBoxes.forEach((box, a) => (box.firstChild.checked = view.axes.includes(a)));
    const hidden = this.axes.length - view.axes.length;
    this.axesSummary.textContent = hidden ? `Axes (${hidden} hidden)` : "Axes";
    byId("agent-list").value = view.agents ? formatList(view.agents) : "";
    this.updateChips();
    byId("key").replaceChildren(...legendOf(this));
    this.ranges.update();
  }

  updateChips() {
    const colored = new Set(this.runs.flatMap((run) => highlightedAgents(run, this.view)));
    for (const [agent, chip] of this.chips.entries()) {
      const states = this.panels.reduce((sum, panel) => sum + (panel.selection.ofAgent[agent] ?? 0), 0);
      const isShown = !this.view.agents || this.view.agents.has(agent);
      chip.textContent = isShown ? `${agent} · ${formatCount(states)}` : `${agent}`;
      chip.setAttribute("aria-pressed", isShown);
      chip.setAttribute("aria-label", isShown ? `agent ${agent}: ${formatCount(states)} states` : `agent ${agent}, hidden`);
      const isColored = this.view.color === "agent" && colored.has(agent);
      chip.style.borderColor = isColored ? `rgb(${this.theme.categorical[agent % this.theme.categorical.length]})` : "";
    }
  }
}

const COLOR_TITLES = {
  density: "number of states",
  agent: "agent",
  outcome: "end of the episode",
  episode: "episode",
  return: "return of the episode",
  difference: "difference from the team",
};

/** One menu is open at a time; Escape and a click elsewhere close it. */
function makeMenus() {
  const menus = [...document.querySelectorAll("details")];
  const closeOthers = (target) => menus.forEach((menu) => (menu.contains(target) ? null : (menu.open = false)));
  addEventListener("pointerdown", ({ target }) => closeOthers(target));
  addEventListener("focusin", ({ target }) => closeOthers(target));
  addEventListener("keydown", ({ key }) => {
    const menu = key === "Escape" && menus.find(({ open }) => open);
    if (!menu) return;
    menu.open = false;
    menu.firstElementChild.focus();
  });
}

/** Says what to do, until there is a range. */
function showHint(app) {
  const { brushes, agents, from, to, first, last } = app.view;
  if (brushes.some(Boolean) || agents || from > first || to < last) return;
  const isTouched = matchMedia("(any-pointer: coarse)").matches && !matchMedia("(any-hover: hover)").matches;
  const text = `${isTouched ? "Slide a finger" : "Drag"} along an axis to select states`;
  app.hint = Object.assign(document.createElement("div"), { className: "hint", textContent: text });
  app.panels[0].plot.parentElement.append(app.hint);
}

function byId(id) {
  return document.getElementById(id);
}

/** Copies a text, and shows it, because some browsers do not let files copy. */
async function copy(text) {
  byId("copied").value = text;
  byId("copied").hidden = false;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    byId("copied").select();
  }
}

async function openPage() {
  const data = JSON.parse(byId("data").textContent);
  const runs = [];
  for (const run of data.runs) runs.push(await loadRun(run, data.axes));
  globalThis.explorer = new App(data, runs);
  document.documentElement.dataset.ready = Math.round(performance.now());
}

openPage().catch((error) => {
  byId("runs").textContent = `This page cannot be shown: ${error.message}. It needs a browser from 2023 or later.`;
  throw error;
});
