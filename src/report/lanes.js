// Who with whom: a lane for each two partners, and the first new contact of each.
const SPAN = (() => { const t = R.steps.map(s => s.t), low = Math.min(0, ...t.slice(0, 1)), high = t.length ? t[t.length - 1] : 1;
  return [low, Math.max(high, low + 1e-9)]; })();
// When something began, over the whole run.
const byTime = t => inRun(Math.min(1, Math.max(0, (t - SPAN[0]) / (SPAN[1] - SPAN[0]))));
const EVENT_COLOUR = { BEGAN: '#1b7f5c', ENDED: '#5b6b7d', SPLIT: '#7a4fb5', MERGED: '#7a4fb5', UNEXPECTED: '#d0021b' };
const EVENT_WORD = { BEGAN: 'began', ENDED: 'ended', SPLIT: 'split', MERGED: 'merged', UNEXPECTED: 'is no longer expected' };
const lanes = { seek: () => {}, cursor: () => {} };
if (!R.partners.length) {
  document.getElementById('lanes').textContent = 'Nothing touched in an answered step.';
} else {
  const names = [], ROWS = 4, ROW = 7, LANE = 20 + ROWS * ROW + 12, height = TOP + R.partners.length * LANE + 26;
  const svg = el('svg', { viewBox: `0 0 ${W} ${height}` }, document.getElementById('lanes'));
  const x = t => LEFT + (W - LEFT - RIGHT) * (t - SPAN[0]) / (SPAN[1] - SPAN[0]);
  R.steps.forEach((s, i) => { if (s.answered || s.status === 'FIRST_FRAME') return;
    const from = i ? R.steps[i - 1].t : SPAN[0];
    el('title', {}, el('rect', { class: 'gap', x: x(from), y: TOP, width: Math.max(1.5, x(s.t) - x(from)), height: height - TOP - 26, fill: '#f6c9c5' }, svg),
      'no answer: ' + s.status + (s.reason ? ': ' + s.reason : '')); });
  R.partners.forEach((p, k) => {
    const y = TOP + k * LANE, floor = y + 20 + ROWS * ROW;
    el('line', { x1: LEFT, x2: W - RIGHT, y1: floor + 5, y2: floor + 5, stroke: '#e3e8ee' }, svg);
    names.push([LEFT, y + 14, partners(p) + (p.left_out ? ` (${p.left_out} more in patches.csv and events.csv)` : '')]);
    const ends = new Array(ROWS).fill(-Infinity);
    p.bars.forEach(([id, from, to, expected]) => {
      let row = ends.findIndex(end => end <= from + 1e-9);
      if (row < 0) row = ROWS - 1;
      ends[row] = Math.max(ends[row], to);
      const what = (id ? `patch ${id}` : 'contacts') + `: ${from.toFixed(4)} s to ${to.toFixed(4)} s` + (expected ? ', expected' : '');
      el('title', {}, el('rect', { class: 'bar', x: x(from), y: y + 20 + row * ROW, width: Math.max(2, x(to) - x(from)), height: ROW - 1,
        fill: expected ? '#a9b3bd' : byTime(from), stroke: '#5b6b7d', 'stroke-width': .4, 'data-t': from }, svg), what); });
    p.events.forEach(([kind, t, id, expected]) => el('title', {}, el('line', { class: 'event', x1: x(t), x2: x(t), y1: floor + (kind === 'BEGAN' ? -2 : 1),
      y2: floor + 9, stroke: EVENT_COLOUR[kind] || '#000', 'stroke-width': 2.2, opacity: expected ? .35 : 1, 'data-t': t }, svg),
      `patch ${id} ${EVENT_WORD[kind] || kind} at ${t.toFixed(4)} s` + (expected ? ', expected' : '')));
  });
  ticks(SPAN[1] - SPAN[0]).forEach(t => el('text', { x: x(SPAN[0] + t), y: height - 8, 'text-anchor': 'middle', 'font-size': 12, fill: '#556' }, svg,
    +(SPAN[0] + t).toPrecision(6) + ' s'));
  const cursor = el('line', { id: 'cursor', y1: TOP, y2: height - 24, stroke: '#2a6fb0', 'stroke-width': 1.5, visibility: 'hidden' }, svg);
  names.forEach(([x, y, text]) => el('text', { class: 'lane', x, y, 'font-size': 13, fill: '#1c2430' }, svg, text));  // over the cursor
  lanes.cursor = t => { cursor.setAttribute('x1', x(t)); cursor.setAttribute('x2', x(t)); cursor.setAttribute('visibility', 'visible'); };
  svg.style.cursor = 'pointer';
  svg.addEventListener('click', e => {  // on a bar or a tick: to its own time
    const box = svg.getBoundingClientRect(), exact = e.target.getAttribute('data-t');
    const t = exact !== null ? +exact : SPAN[0] + ((e.clientX - box.left) * W / box.width - LEFT) / (W - LEFT - RIGHT) * (SPAN[1] - SPAN[0]);
    lanes.seek(Math.min(SPAN[1], Math.max(SPAN[0], t))); });
}
const calendar = stamp => +stamp > 1e8 ? new Date(+stamp * 1000).toISOString().replace('T', ' ').replace('Z', ' UTC') : '';
{ const firsts = R.partners.filter(p => p.first).sort((p, q) => p.first.t - q.first.t);
  const t = table('firsts', ['first new contact', 'after the start [s]', 'stamp [s]', 'where x, y, z [m]'], firsts.map(p =>
    [p.first.text, p.first.t.toFixed(4), p.first.stamp + (calendar(p.first.stamp) ? ` (${calendar(p.first.stamp)})` : ''), p.first.where.map(v => v.toFixed(3)).join(', ')]));
  if (t) firsts.forEach((p, i) => { t.rows[i + 1].style.cursor = 'pointer'; t.rows[i + 1].addEventListener('click', () => lanes.seek(p.first.t)); });
  const of = name => R.steps.filter(s => s.answered && s.start_state === name).length;
  const facts = document.getElementById('facts').insertRow();
  facts.insertCell().textContent = 'surfaces when steps began';
  facts.insertCell().textContent = ['CLEAR', 'INTERSECTING', 'NOT_CHECKED'].map(n => `${of(n)} ${n}`).join(', ') + `; frames without an answer: ${R.steps.filter(s => !s.answered).length}`;
  [...facts.cells].forEach(c => c.className = 'text'); }
