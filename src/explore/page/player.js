"use strict";
/* The filmed episodes of a run: a menu, a slider of steps and the bodies of the state that is shown. */

/** Milliseconds between two pictures of a film, and their maximum number. */
const FILM_INTERVAL = 40;
const FILM_PICTURES = 500;

class Player {
  constructor(panel) {
    Object.assign(this, { panel, film: panel.run.film, state: 0, isMarked: false });
    const find = (selector) => panel.element.querySelector(`.film ${selector}`);
    [this.menu, this.button, this.slider, this.output, this.canvas] = [".filmed", ".play-film", ".step", "output", ".scene"].map(find);
    this.menu.replaceChildren(...this.film.episodes.map((filmed, f) => new Option(filmedTitle(panel.run, filmed), f)));
    const [count, recorded] = [this.film.episodes.length, this.film.recorded];
    if (count < recorded) this.menu.append(Object.assign(new Option(`${count} of ${recorded} filmed episodes`), { disabled: true }));
    this.menu.onchange = () => this.show(this.film.episodes[this.menu.value].first);
    this.slider.oninput = () => this.show(this.filmed.first + Number(this.slider.value));
    this.button.onclick = () => (this.playing ? this.stop() : this.play());
  }

  /** The filmed episode that is shown. */
  get filmed() {
    return this.film.episodes.findLast(({ first }) => first <= this.state);
  }

  /** Shows a filmed state, and marks it in the plots. */
  show(state) {
    [this.state, this.isMarked] = [state, true];
    this.draw();
  }

  /** Plays from the step that is shown, or from the first one if it is the last. */
  play() {
    const { first, count } = this.filmed;
    if (this.state === first + count - 1) this.show(first);
    this.playing = setInterval(() => {
      const last = this.filmed.first + this.filmed.count - 1;
      this.show(Math.min(this.state + Math.ceil(this.filmed.count / FILM_PICTURES), last));
      if (this.state === last) this.stop();
    }, FILM_INTERVAL);
    this.update();
  }

  stop() {
    clearInterval(this.playing);
    this.playing = null;
    this.update();
  }

  draw() {
    const { theme } = this.panel.app;
    const [context, size] = fitCanvas(this.canvas);
    drawScene(context, size, this.film, this.state, { ...theme, accent: agentColor(theme, this.filmed.agent) });
    this.update();
    this.panel.drawMarks();
  }

  update() {
    const { agent, episode, first, count } = this.filmed;
    const step = this.state - first;
    this.menu.value = this.film.episodes.indexOf(this.filmed);
    Object.assign(this.slider, { max: count - 1, value: step });
    this.output.textContent = `step ${step} of ${count - 1}`;
    this.button.textContent = this.playing ? "Pause" : "Play";
    this.button.setAttribute("aria-label", this.playing ? "Pause the film" : "Play the film");
    this.canvas.setAttribute("aria-label", `Bodies of agent ${agent} in episode ${episode}, step ${step}`);
  }
}

function filmedTitle(run, { e, agent, episode }) {
  const value = run.episodes.return[e];
  return `agent ${agent}, episode ${episode}${e < 0 ? "" : `, return ${formatNumber(value)}`}`;
}

/** The context of a canvas with one pixel per pixel of the screen, cleared, and its size in pixels of the page. */
function fitCanvas(canvas) {
  const ratio = Math.min(globalThis.devicePixelRatio || 1, 2);
  const size = [canvas.clientWidth, canvas.clientHeight];
  [canvas.width, canvas.height] = size.map((length) => Math.round(length * ratio));
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  return [context, size];
}
