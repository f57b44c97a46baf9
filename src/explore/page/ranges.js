"use strict";
/* The selected ranges as numbers, which can be typed. */

/** Both ends of a brush as texts, empty at an end of the axis: the shortest numbers with the levels of the brush. */
function shortTexts(axis, brush) {
  const power = Math.ceil(Math.log10(axis.high - axis.low));
  return brushValues(axis, brush).map((value, end) => {
    if (!Number.isFinite(value)) return "";
    for (let digits = 1; digits < 9; digits++) {
      const step = 10 ** (power - digits);
      const number = Number((Math.round(value / step) * step).toPrecision(12));
      if (brushOf(axis, end ? -Infinity : number, end ? number : Infinity)?.[end] === brush[end]) return String(number);
    }
    return String(value);
  });
}

class Ranges {
  constructor(app) {
    /* `opened`: axes whose range is typed, but need not select yet; `typed`: inputs with a text that is not used yet. */
    Object.assign(this, { app, opened: new Set(), typed: new Set(), list: byId("ranges"), menu: byId("add-range"), rows: [] });
    this.menu.lastChild.replaceChildren(...app.axes.map((axis, a) => {
      const button = Object.assign(document.createElement("button"), { textContent: axisTitle(axis) });
      button.onclick = () => this.open(a);
      return button;
    }));
  }

  /** Lets a person type the range of an axis. */
  open(a) {
    this.menu.open = false;
    this.opened.add(a);
    this.update();
    const { inputs } = this.rows.find((row) => row.a === a);
    inputs[0].focus();
    inputs[0].select();
  }

  update() {
    const { brushes } = this.app.view;
    const shown = this.app.axes.flatMap((_, a) => (brushes[a] || this.opened.has(a) ? [a] : []));
    if (shown.join() !== this.rows.map(({ a }) => a).join()) {
      const known = new Map(this.rows.map((row) => [row.a, row]));
      this.rows = shown.map((a) => known.get(a) ?? this.row(a));
      this.list.replaceChildren(...this.rows.map(({ element }) => element));
    }
    for (const { a, inputs } of this.rows) {
      const texts = brushes[a] ? shortTexts(this.app.axes[a], brushes[a]) : ["", ""];
      for (const [end, input] of inputs.entries()) if (!this.typed.has(input)) input.value = texts[end];
    }
  }

  /** The row of an axis: two numbers, empty at an end of the axis, and a button. */
  row(a) {
    const axis = this.app.axes[a];
    const element = document.createElement("li");
    const inputs = ["from", "to"].map((word, end) => {
      const placeholder = formatNumber(end ? axis.high : axis.low);
      const input = Object.assign(document.createElement("input"), { type: "number", step: "any", placeholder });
      input.setAttribute("aria-label", `${axisTitle(axis)}, ${word}`);
      input.oninput = () => this.typed.add(input);
      input.onchange = () => this.read(a, inputs);
      return input;
    });
    const button = Object.assign(document.createElement("button"), { textContent: "×", title: "Remove this range" });
    button.setAttribute("aria-label", `Remove the range of ${axisTitle(axis)}`);
    button.onclick = () => this.remove(a);
    element.append(`${axisTitle(axis)} `, inputs[0], " to ", inputs[1], " ", button);
    element.addEventListener("focusout", (event) => this.leave(a, element, event.relatedTarget));
    return { a, element, inputs };
  }

  /** Selects the typed range. */
  read(a, inputs) {
    const numbers = inputs.map(({ value }, end) => (value === "" ? [-Infinity, Infinity][end] : Number(value)));
    const brush = brushOf(this.app.axes[a], ...numbers);
    inputs[1].setCustomValidity(brush ? "" : "no value is in this range");
    if (!brush) return inputs[1].reportValidity();
    inputs.forEach((input) => this.typed.delete(input));
    return this.app.setBrush(a, brush);
  }

  remove(a) {
    this.opened.delete(a);
    this.app.setBrush(a, null);
    this.menu.firstChild.focus();
  }

  /** A row without a range is removed when the focus leaves it. */
  leave(a, element, target) {
    if (element.contains(target)) return;
    this.opened.delete(a);
    this.app.redraw();
  }
}
