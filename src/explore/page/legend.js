"use strict";
/* What colors mean. */

/** Texts and samples of the colors of a view. */
function legendOf({ view, panels, theme, agentCount }) {
  const scale = (low, high, stops) => [low, scaleOf(stops), high];
  const most = Math.max(...panels.map((panel) => panel.maxLines), 1);
  const density = Array.from({ length: 9 }, (_, i) => mixStops(theme.density, logShare(1, most) + (i / 8) * (1 - logShare(1, most))));
  const means = (name, [low, high]) => [`mean ${name}: `, ...scale(formatNumber(low), formatNumber(high), theme.sequential)];
  const outcomes = outcomeColors(theme);
  return {
    density: ["lines per pixel: ", ...scale("1", `${formatCount(most)} (logarithmic)`, density)],
    agent: [`the agent with most states; gray: shared by agents${agentCount > 8 ? ", or not one of the first eight shown" : ""}`],
    outcome: [swatchOf(outcomes[0]), "terminated", swatchOf(outcomes[1]), "truncated, gray: both"],
    episode: means("episode", [view.from, view.to]),
    return: means("return", view.returns),
    difference: ["its share of states: ", ...scale("below the team's", "above it", theme.difference)],
  }[view.color];
}

function scaleOf(stops) {
  const scale = Object.assign(document.createElement("span"), { className: "scale" });
  scale.style.background = `linear-gradient(90deg, ${stops.map((color) => `rgb(${color})`).join()})`;
  return scale;
}

function swatchOf(color) {
  const swatch = Object.assign(document.createElement("span"), { className: "swatch" });
  swatch.style.background = `rgb(${color})`;
  return swatch;
}
