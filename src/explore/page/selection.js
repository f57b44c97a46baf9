"use strict";
/* Which states are selected, and how many of them lead from each bin of an axis to each bin of another
   one. A view has `brushes` (per axis: null, or the first and the last selected level), `agents` (null for
   all, or a set), the range of episodes `from` to `to`, and `axes` (those shown, from left to right). */

/** 1 for each episode of which states may be selected. */
function admittedEpisodes(run, view, useBrushes) {
  const { episodes, episodeLevels } = run;
  const admitted = new Uint8Array(episodes.count);
  for (let e = 0; e < episodes.count; e++) {
    const number = episodes.episode[e];
    let admits = number >= view.from && number <= view.to;
    admits &&= !view.agents || view.agents.has(episodes.agent[e]);
    for (let a = 0; useBrushes && admits && a < view.brushes.length; a++) {
      const brush = view.brushes[a];
      const levels = episodeLevels[a];
      if (brush && levels) admits = levels[e] >= brush[0] && levels[e] <= brush[1];
    }
    admitted[e] = admits ? 1 : 0;
  }
  return admitted;
}

/** Levels and ends of the brushes that tell states of an episode apart. A run without the quantity of a
    brush has no selected state: null. */
function stateBrushes(run, view) {
  const brushes = [];
  for (const [a, brush] of view.brushes.entries()) {
    if (!brush || run.episodeLevels[a]) continue;
    if (!run.levels[a]) return null;
    brushes.push({ levels: run.levels[a], low: brush[0], high: brush[1] });
  }
  return brushes;
}

/** The selected states in `list`, `count` of them, and what they belong to. */
function select(run, view, useBrushes, buffer) {
  const brushes = useBrushes ? stateBrushes(run, view) : [];
  const admitted = admittedEpisodes(run, view, useBrushes);
  const result = { list: buffer, count: 0, episodes: 0, terminated: 0, returns: 0, nanReturns: 0, ofAgent: new Uint32Array(run.agents) };
  for (let e = 0; brushes && e < admitted.length; e++) {
    if (!admitted[e]) continue;
    const before = result.count;
    result.count = selectOfEpisode(run.starts[e], run.starts[e + 1], brushes, buffer, before);
    if (result.count === before) continue;
    result.episodes++;
    result.terminated += run.episodes.terminated[e];
    if (Number.isNaN(run.episodes.return[e])) result.nanReturns++;
    else result.returns += run.episodes.return[e];
    result.ofAgent[run.episodes.agent[e]] += result.count - before;
  }
  return result;
}

function selectOfEpisode(start, end, brushes, list, count) {
  const [first, second] = brushes;
  if (brushes.length > 2) return selectByAll(start, end, brushes, list, count);
  for (let i = start; i < end; i++) {
    if (first && (first.levels[i] < first.low || first.levels[i] > first.high)) continue;
    if (second && (second.levels[i] < second.low || second.levels[i] > second.high)) continue;
    list[count++] = i;
  }
  return count;
}

function selectByAll(start, end, brushes, list, count) {
  states: for (let i = start; i < end; i++) {
    for (const brush of brushes) {
      const level = brush.levels[i];
      if (level < brush.low || level > brush.high) continue states;
    }
    list[count++] = i;
  }
  return count;
}

/** Number of selected states per pair of bins: `[BINS × BINS]`. */
function countPairs(run, first, second, { list, count }, counts) {
  counts.fill(0);
  const one = run.bins[first];
  const other = run.bins[second];
  if (!one || !other) return;
  for (let k = 0; k < count; k++) {
    const i = list[k];
    const row = one[i];
    const column = other[i];
    if (row !== NO_BIN && column !== NO_BIN) counts[row * BINS + column]++;
  }
}

/** Number of selected states per pair of bins, and the sum of one number per episode over them. Sums leave NaN
    out, whose states are counted in `nans`. */
function sumPairs(run, first, second, { list, count }, numbers, counts, sums, nans) {
  counts.fill(0);
  sums.fill(0);
  nans.fill(0);
  const one = run.bins[first];
  const other = run.bins[second];
  if (!one || !other) return;
  const { episodeOf } = run;
  for (let k = 0; k < count; k++) {
    const i = list[k];
    const row = one[i];
    const column = other[i];
    if (row === NO_BIN || column === NO_BIN) continue;
    const pair = row * BINS + column;
    counts[pair]++;
    const number = numbers[episodeOf[i]];
    if (Number.isNaN(number)) nans[pair]++;
    else sums[pair] += number;
  }
}

/** The selected states of each of these agents, as further selections. `buffer` has room for all of them. */
function splitByAgent(run, selection, agents, buffer) {
  let start = 0;
  const parts = agents.map((agent) => {
    const list = buffer.subarray(start, start + selection.ofAgent[agent]);
    start += list.length;
    return { list, count: 0, agent };
  });
  const partOf = Array.from({ length: run.agents }, (_, agent) => parts.find((part) => part.agent === agent));
  const { episodeOf, episodes } = run;
  for (let k = 0; k < selection.count; k++) {
    const i = selection.list[k];
    const part = partOf[episodes.agent[episodeOf[i]]];
    if (part) part.list[part.count++] = i;
  }
  return parts;
}

/** Number of selected states per class of their episode and pair of bins: `[classes × BINS × BINS]`. */
function countClasses(run, first, second, { list, count }, classes, counts) {
  counts.fill(0);
  const one = run.bins[first];
  const other = run.bins[second];
  if (!one || !other) return;
  const { episodeOf } = run;
  for (let k = 0; k < count; k++) {
    const i = list[k];
    const row = one[i];
    const column = other[i];
    if (row !== NO_BIN && column !== NO_BIN) counts[(classes[episodeOf[i]] * BINS + row) * BINS + column]++;
  }
}

/** Index of the filmed state, among those selected, whose line is nearest to a point: `at` counts axes from
    the left, `height` is the share of the axis below the point. -1 if there is none. */
function nearestFilmed(run, view, at, height) {
  const { film } = run;
  if (!film) return -1;
  const left = view.axes[Math.floor(at)];
  const right = view.axes[Math.min(Math.ceil(at), view.axes.length - 1)];
  const admitted = admittedEpisodes(run, view, true);
  let nearest = -1;
  let smallest = Infinity;
  for (let s = 0; s < film.states.length; s++) {
    const [from, to] = [film.levels[left][s], film.levels[right][s]];
    if (from === MISSING || to === MISSING || !admitted[film.states[s].e]) continue;
    const distance = Math.abs((from + (at % 1) * (to - from)) / MAX_LEVEL - height);
    if (distance < smallest && isFilmedSelected(film, view, s)) [nearest, smallest] = [s, distance];
  }
  return nearest;
}

function isFilmedSelected(film, view, s) {
  return view.brushes.every((brush, a) => {
    const level = film.levels[a][s];
    return !brush || (level >= brush[0] && level <= brush[1]);
  });
}
