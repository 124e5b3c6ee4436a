// Plots are as wide as the page, so that their words stay as large as the others.
const NS = 'http://www.w3.org/2000/svg', W = Math.max(300, document.getElementById('lanes').clientWidth || 1040), LEFT = 66,
  RIGHT = 14, BOTTOM = 34, TOP = 10;
const el = (name, attributes, parent, text) => {
  const e = document.createElementNS(NS, name);
  for (const k in attributes) e.setAttribute(k, attributes[k]);
  if (text !== undefined) e.textContent = text;
  if (parent) parent.appendChild(e);
  return e;
};
const number = x => x === null || x === undefined ? '–' : Number.isInteger(x) ? x.toLocaleString('en') :
  Math.abs(x) >= 100 ? x.toLocaleString('en', { maximumFractionDigits: 1 }) : Math.abs(x) >= 1e-3 ? x.toFixed(3) : x.toExponential(1);
// Three digits that mean something: 0.355, 11.2, 1,120.
const short = x => (+x.toPrecision(3)).toLocaleString('en', { maximumFractionDigits: 6 });
const bar = share => ({ share });
const partners = p => p.names[0] === p.names[1] ? p.names[0] + ' with itself' : p.names.join(' with ');
function table(id, head, rows) {
  const t = document.getElementById(id);
  if (!rows.length) { t.outerHTML = '<p class="note">None.</p>'; return; }
  const wide = document.createElement('div'); wide.className = 'wide'; t.replaceWith(wide); wide.appendChild(t);
  const text = rows[0].map((_, k) => rows.every(r => typeof r[k] === 'string'));
  const add = (cells, tag) => {
    const row = t.insertRow();
    cells.forEach((cell, k) => {
      const d = row.appendChild(document.createElement(tag));
      if (cell !== null && typeof cell === 'object') {
        d.className = 'bar';
        d.appendChild(document.createElement('div')).style.width = 100 * cell.share + '%';
      } else {
        d.textContent = typeof cell === 'string' ? cell : number(cell);
        if (text[k]) d.className = 'text';
      }
    });
  };
  if (head) add(head, 'th');
  rows.forEach(r => add(r, 'td'));
  return t;
}
// Round steps, so that a reader can tell the values between.
function ticks(max, whole) {
  const raw = max / 5, power = 10 ** Math.floor(Math.log10(raw)), lead = raw / power;
  let step = (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10) * power;
  if (whole) step = Math.max(1, Math.round(step));
  const out = [];
  for (let v = 0; v <= max * (1 + 1e-9); v += step) out.push(+v.toPrecision(10));
  return out;
}
// `rise`: how high a value stands, 0 to 1 at ymax; without it evenly.
function axes(id, height, ymax, ylabel, whole, rise = v => v / ymax, marks = ticks(ymax, whole)) {
  const steps = R.steps, t0 = steps.length ? steps[0].t : 0;
  const span = Math.max((steps.length > 1 ? steps[steps.length - 1].t : t0 + 1) - t0, 1e-9);
  const svg = el('svg', { viewBox: `0 0 ${W} ${height}` }, document.getElementById(id));
  const slot = (W - LEFT - RIGHT) / Math.max(steps.length, 1), inner = W - LEFT - RIGHT - slot;
  const x = t => LEFT + slot / 2 + inner * (t - t0) / span, y = v => height - BOTTOM - (height - BOTTOM - TOP) * rise(v);
  steps.forEach(s => { if (s.answered) return;
    const w = Math.max(2, slot);
    el('title', {}, el('rect', { x: x(s.t) - w / 2, y: TOP, width: w, height: height - BOTTOM - TOP, fill: '#f6c9c5' }, svg),
      s.status + (s.reason ? ': ' + s.reason : '')); });
  marks.forEach(v => {
    el('line', { x1: LEFT, x2: W - RIGHT, y1: y(v), y2: y(v), stroke: '#e3e8ee' }, svg);
    el('text', { x: LEFT - 6, y: y(v) + 4, 'text-anchor': 'end', 'font-size': 12, fill: '#556' }, svg, v.toLocaleString('en')); });
  ticks(span).forEach(t => x(t0 + t) <= W - RIGHT && el('text', { x: x(t0 + t), y: height - BOTTOM + 18, 'text-anchor': 'middle', 'font-size': 12,
    fill: '#556' }, svg, +(t0 + t).toPrecision(6) + ' s'));
  el('text', { x: 11, y: height / 2, 'font-size': 12, fill: '#556', transform: `rotate(-90 11 ${height / 2})`,
    'text-anchor': 'middle' }, svg, ylabel);
  return { svg, x, y, bar: Math.max(1.5, 0.8 * slot) };
}
document.getElementById('headline').textContent = R.headline;
// What a reader is to know first: what is proved, what was looked at, what touched when. firsts: click to go there.
{ const card = (kind, title, ...lines) => { const d = document.getElementById('verdict').appendChild(document.createElement('div'));
    d.className = kind; d.appendChild(document.createElement('strong')).textContent = title;
    lines.forEach(([text, t]) => { const p = d.appendChild(document.createElement('p')); p.textContent = text;
      if (t !== undefined) { p.dataset.t = t; p.addEventListener('click', () => lanes.seek(t)); } }); };
  const P = R.proof, steps = n => n + (n === 1 ? ' step' : ' steps'), fact = (R.facts.find(([name]) => name === 'octomap') || ['', ''])[1];
  if (P.doubts.length) card('doubt', 'In doubt', ...P.doubts.map(text => [text]));
  if (!P.unproved) card('good', P.steps === 1 ? 'The only step is proved' : `All ${steps(P.steps)} are proved`, ['What does not touch is known not to.']);
  else card('doubt', P.proved ? `${P.steps - P.proved} of ${steps(P.steps)} are not proved` : 'Nothing is proved', [P.unproved]);
  const unseen = P.not_looked_at.map(text => [text[0].toUpperCase() + text.slice(1) + '.']), mapless = /^(none|off)/.test(fact);
  if (fact) card(mapless || unseen.length ? 'doubt' : 'good', mapless ? 'No map was used' : 'The map was used', ...(mapless ? [] : [[fact]]), ...unseen);
  const firsts = R.partners.filter(p => p.first).sort((p, q) => p.first.t - q.first.t);
  const lasting = R.partners.filter(p => !p.first && p.bars.length).map(p => [partners(p) + (p.bars.every(b => b[3]) ? ': as expected' : ': since before it was looked at'), p.bars[0][1]]);
  const answered = R.steps.some(s => s.answered), lines = firsts.map(p => [`${partners(p)}: ${p.first.t.toFixed(3)} s after the start`, p.first.t]).concat(lasting);
  card(lines.length ? '' : answered && !P.unproved ? 'good' : 'doubt', firsts.length ? 'First contact' : lines.length ? 'No new contact' : answered ? 'Nothing was found to touch' : 'No answer',
    ...lines.slice(0, 6), ...(lines.length > 6 ? [[`${lines.length - 6} more pairs below`]] : [])); }
{ const t = table('facts', null, R.facts);  // what has many lines is folded under the first
  R.facts.forEach(([, value], i) => { const end = value.indexOf('\n'), cell = t.rows[i].cells[1]; if (end < 0) return;
    const fold = document.createElement('details'); cell.textContent = ''; cell.appendChild(fold);
    fold.appendChild(document.createElement('summary')).textContent = value.slice(0, end);
    fold.appendChild(document.createElement('pre')).textContent = value.slice(end + 1); }); }
{ const most = Math.max(1, ...R.steps.map(s => s.contacts)), some = R.steps.map(s => s.contacts).filter(n => n).sort((p, q) => p - q);
  // One step with thousands is not to flatten all others.
  const steep = some.length && most > 20 * some[some.length >> 1], power = n => Math.log10(1 + n) / Math.log10(1 + most);
  const a = steep ? axes('contacts', 240, most, 'contacts (logarithmic)', true, power, [0, ...[1, 10, 100, 1e3, 1e4, 1e5, 1e6].filter(n => n <= most)])
    : axes('contacts', 240, most, 'contacts', true);
  R.steps.forEach(s => [[s.contacts, '#2a6fb0'], [s.undecided + s.initial, '#f0a030'], [s.initial, '#9aa4b0']].forEach(([n, fill]) => {
    const top = a.y(Math.min(n, s.contacts));
    if (n && s.contacts) el('title', {}, el('rect', { x: a.x(s.t) - a.bar / 2, y: top, width: a.bar, height: a.y(0) - top, fill }, a.svg),
      `step ${s.step}: ${s.contacts} contacts, ${s.undecided} undecided, ${s.initial} initial`); })); }
{ const longest = Math.max(1e-3, ...R.steps.map(s => s.ms)), usual = 2 * R.total.p95_ms;
  // One long step is not to flatten all others: it is cut, and its number written.
  const most = longest > 2 * usual && usual > 0 ? usual : longest, answered = R.steps.filter(s => s.answered), cut = answered.filter(s => s.ms > most);
  const a = axes('latency', 180, most, 'ms');
  el('polyline', { points: answered.map(s => `${a.x(s.t)},${a.y(Math.min(s.ms, most))}`).join(' '), fill: 'none',
    stroke: '#2a6fb0', 'stroke-width': 1.3 }, a.svg);
  let free = -Infinity;
  cut.forEach(s => { if (a.x(s.t) < free) return; free = a.x(s.t) + 50;
    el('text', { class: 'cut', x: a.x(s.t) + 3, y: TOP + 10, 'font-size': 11, fill: '#556' }, a.svg, short(s.ms)); });
  el('line', { x1: LEFT, x2: W - RIGHT, y1: a.y(R.total.median_ms), y2: a.y(R.total.median_ms), stroke: '#f0a030' }, a.svg);
  document.getElementById('latency_note').textContent = `Median ${number(R.total.median_ms)} ms (orange line), 95 % below ` +
    `${number(R.total.p95_ms)} ms, 99 % below ${number(R.total.p99_ms)} ms, longest ${number(R.total.max_ms)} ms.`; }

// Points {x, y, name, group, missed, invented}: time across, error up, both logarithmic. Errors below `least` are drawn there.
const COLOURS = ['#1c2430', '#2a6fb0', '#f0a030', '#3d9a50', '#8e5bb0', '#b71c1c', '#7a8794'];
// Lower and upper bound of the distance of each two partners; a gap where nothing is known.
if (!R.clearance.curves.length) document.getElementById('clearance_part').remove();
else { const all = R.clearance.curves, hue = k => COLOURS[1 + k % (COLOURS.length - 1)], who = c => partners(c) + (c.expected ? ', expected' : '');
  const a = axes('clearance', 220, Math.max(1e-6, ...all.flatMap(c => c.samples.map(s => s[2] ?? s[1] ?? 0))), 'distance [m]');
  all.forEach((c, k) => [[2, '4 3'], [1, 'none']].forEach(([bound, dashes]) => { let run = [];
    const end = () => { if (run.length) el('title', {}, el('polyline', { points: run.join(' '), fill: 'none', stroke: hue(k), 'stroke-width': 1.5,
      'stroke-dasharray': dashes, opacity: c.expected ? .45 : 1 }, a.svg), who(c)); run = []; };
    c.samples.forEach(s => s[bound] === null ? end() : run.push(`${a.x(s[0])},${a.y(s[bound])}`)); end(); }));
  const note = document.getElementById('clearance_note');
  note.textContent = 'The smallest distance of each two partners in each step: a lower bound, and dashed an upper one, which is missing where they are further apart than clearance/max_m. A gap: nothing is known.';
  all.forEach((c, k) => { note.appendChild(document.createElement('i')).style.background = hue(k); note.append(who(c)); });
  document.getElementById('promises').textContent = R.promises;
  if (R.clearance.left_out) note.append(` and ${R.clearance.left_out} more in clearance.csv`); }
// The scale of a step holds until the next.
{ const scaled = R.steps.filter(s => s.scales);
  if (!scaled.length) document.getElementById('scales_part').remove();
  else { const a = axes('scales', 180, 1, 'scale');
    [[1, '#f0a030'], [0, '#2a6fb0']].forEach(([k, stroke]) => el('polyline', { 'stroke-width': 1.5, stroke, fill: 'none', points: scaled.flatMap((s, i) =>
      [i ? scaled[i - 1] : s, s].map(before => `${a.x(s.t)},${a.y(before.scales[k])}`)).join(' ') }, a.svg)); } }
function frontPlot(id, all, xlabel, ylabel, least) {
  const H = 400, floor = H - 46, box = document.getElementById(id), points = all.filter(p => p.x > 0 && p.y !== null).map(p => ({ ...p, y: Math.max(p.y, least) }));
  if (!points.length) { box.remove(); return; }
  const range = (values, room) => { const low = Math.log10(Math.min(...values)), high = Math.log10(Math.max(...values)), pad = room * Math.max(high - low, 0.3);
    return [low - pad, high + pad]; };
  const [x0, x1] = range(points.map(p => p.x), 0.12), [y0, y1] = range(points.map(p => p.y), 0.08);
  const x = v => LEFT + 20 + (W - LEFT - RIGHT - 30) * (Math.log10(v) - x0) / (x1 - x0), y = v => floor - (floor - TOP - 24) * (Math.log10(v) - y0) / (y1 - y0);
  const svg = el('svg', { viewBox: `0 0 ${W} ${H}` }, box);
  const label = (x, y, text, more) => el('text', { x, y, 'font-size': 12, fill: '#556', ...more }, svg, text);
  const logTicks = (low, high, steps) => { const out = [];
    for (let d = Math.floor(low); d <= high; ++d) for (const k of steps) if (d + Math.log10(k) >= low && d + Math.log10(k) <= high) out.push(k * 10 ** d);
    return out; };
  logTicks(x0, x1, x1 - x0 < 2 ? [1, 2, 5] : [1]).forEach(v => {
    el('line', { x1: x(v), x2: x(v), y1: TOP, y2: floor, stroke: '#e3e8ee' }, svg); label(x(v), floor + 18, short(v), { 'text-anchor': 'middle' }); });
  logTicks(y0, y1, y1 - y0 < 2 ? [1, 2, 5] : [1]).forEach(v => {
    el('line', { x1: LEFT, x2: W - RIGHT, y1: y(v), y2: y(v), stroke: '#e3e8ee' }, svg);
    label(LEFT - 6, y(v) + 4, v <= least ? '0' : v < 1e-2 ? v.toExponential(0) : +v.toPrecision(2), { 'text-anchor': 'end' }); });
  label((W + LEFT) / 2, H - 8, xlabel, { 'text-anchor': 'middle' });
  label(11, H / 2, ylabel, { transform: `rotate(-90 11 ${H / 2})`, 'text-anchor': 'middle' });
  let best = Infinity;
  const front = points.filter(p => !p.missed && !p.invented).sort((a, b) => a.x - b.x || a.y - b.y).filter(p => p.y < best && (best = p.y, true));
  el('polyline', { points: front.map((p, i) => (i ? `${x(p.x)},${y(front[i - 1].y)} ` : '') + `${x(p.x)},${y(p.y)}`).join(' '), fill: 'none', stroke: '#9aa4b0' }, svg);
  const groups = [...new Set(points.map(p => p.group))], taken = [];
  const legend = box.appendChild(document.createElement('p')); legend.className = 'note';
  groups.forEach((g, k) => { const key = legend.appendChild(document.createElement('span'));
    key.appendChild(document.createElement('i')).style.background = COLOURS[k % COLOURS.length]; key.append(g); legend.append(' '); });
  [...front, ...points.filter(p => !front.includes(p))].forEach(p => {
    const cx = x(p.x), cy = y(p.y), mark = el('circle', { cx, cy, r: 5, fill: COLOURS[groups.indexOf(p.group) % COLOURS.length] }, svg);
    el('title', {}, mark, `${p.group} ${p.name}: ${short(p.x)}, ${+p.y.toPrecision(3)}; ${p.missed} missed, ${p.invented} invented`);
    if (p.missed) el('path', { d: `M${cx - 8},${cy - 8}l16,16m-16,0l16,-16`, stroke: '#b71c1c', 'stroke-width': 2 }, svg);
    if (p.invented) el('circle', { cx, cy, r: 10, fill: 'none', stroke: '#b71c1c', 'stroke-width': 2 }, svg);
    const width = 15 + 6.5 * p.name.length, left = cx + width > W, from = left ? cx - width : cx, end = from + width;  // no room on the right
    const covers = (a, b) => a + 5 > from && a - 10 < end && Math.abs(b - cy) < 13;
    if (taken.some(([a, b, to]) => a < end && to > from && Math.abs(b - cy) < 13) || points.some(q => q !== p && covers(x(q.x), y(q.y)))) return;
    taken.push([from, cy, end]); label(cx + (left ? -13 : 13), cy - (front.includes(p) ? 4 : -4), p.name, left ? { 'text-anchor': 'end' } : {}); });
}

// Of times, 0 to 1, early dark and late pale: red within a step, as in RViz, blue within the run.
const ramp = stops => f => { const i = Math.min(1, Math.floor(f * 2)), w = f * 2 - i;
  return 'rgb(' + stops[i].map((c, k) => Math.round(c + w * (stops[i + 1][k] - c))).join(',') + ')'; };
const early = ramp([[183, 28, 28], [251, 140, 60], [255, 236, 179]]), inRun = ramp([[10, 60, 95], [50, 145, 165], [180, 222, 215]]);
const gradient = times => 'linear-gradient(to right,' + [0, .5, 1].map(times).join(',') + ')';
table('touched', ['body', 'vertices', 'touched at some time', 'most often', 'first touch [s]'], R.bodies.map(b => [
  b.name, b.count.length, b.count.filter(n => n).length, b.count.reduce((most, n) => Math.max(most, n), 0),
  b.first.reduce((least, t) => least === null || (t !== null && t < least) ? t : least, null)]));
const MEANING = { FIRST_FRAME: 'a step needs two frames', PARTIAL: 'vertices could not be checked, or left the path',
  DEADLINE: 'the step budget ran out', TRUNCATED: 'more contacts than max_contacts; the earliest are listed' };
const STAGE = { record: 'takes in the frames', bounds: 'boxes of what the features sweep', broad_phase: 'pairs whose boxes meet',
  planar: 'filters in a line and a plane', elementary: 'the test of the chosen accuracy', obstacle: 'all of it against the map',
  start_state: 'do surfaces cross at the start?', sort: 'contacts in their order' };
const NOT_OK = R.steps.filter(s => s.status !== 'OK'), SHOWN = 500;
table('seams', ['time [s]', 'step', 'status', 'reason'], NOT_OK.slice(0, SHOWN).map(s => [number(s.t), String(s.step), s.status, s.reason || MEANING[s.status] || ''])
  .concat(NOT_OK.length > SHOWN ? [['', '', '…', `${NOT_OK.length - SHOWN} more in steps.csv`]] : []));
const longest = list => Math.max(1e-12, ...list);
{ const most = longest(R.stages.map(s => s.median_ms));
  table('stages', ['stage', '', 'pairs in', 'pairs out', 'median ms', '', '95 % ms'], R.stages.map(s =>
    [s.name, STAGE[s.name] || '', s.in, s.out, s.median_ms, bar(s.median_ms / most), s.p95_ms]).concat(
    [['whole step', '', '', '', R.total.median_ms, '', R.total.p95_ms]])); }
{ const most = longest(R.effects.map(e => e.ms || 0));
  const t = table('effects', ['effect', 'runs', 'why', 'pairs in', 'pairs out', 'ms in all', ''], R.effects.map(e =>
    [e.name, e.running ? 'yes' : 'no', e.reason, e.in, e.out, e.ms, bar((e.ms || 0) / most)]));
  R.effects.forEach((e, i) => { if (!e.running) t.rows[i + 1].className = 'off'; }); }
document.getElementById('effects_note').textContent =
  `Each pair and each moment counts in one row alone: a pair that carries a distance in tracker_noise or else minimum_separation, no longer in self_collision, body_body or octomap. Bounds of bodies: ${R.step_counters.bodies_refitted} times computed, ${R.step_counters.bodies_kept} times kept from the step before.` +
  (R.step_counters.left_out_met ? ` Pairs that are closer in the reference frame than their separation or uncertainty, and left out of it, came up ${R.step_counters.left_out_met} times.` : '');
{ const l = R.look_ahead; if (l) table('look_ahead', ['horizon [s]', 'came true', 'not observed', 'not predicted'],
  [[l.horizon_s, l.came_true, l.not_observed, l.not_predicted]]);
  else document.getElementById('look_ahead_part').remove(); }
if (!R.study) document.getElementById('study_part').remove();
else { const rows = R.study.rows, percent = v => `${(100 * v).toFixed(v < 0.0995 ? 1 : 0)} %`;
  document.getElementById('study_part').open = true;
  const again = rows.find(r => r.setting === 'the same again');
  document.getElementById('study_sentence').textContent = R.study.sentence + (again ? ` The same run twice differs in time by ${percent(Math.abs(again.share_of_time - 1))}: settings that differ less do not differ.` : '');
  frontPlot('study_plot', rows.map(r => ({ x: r.ms_per_s, y: r.patches_missed < r.patches_touched ? r.patches_p95_ms : null, name: r.setting, group: r.varied, missed: r.patches_missed, invented: r.patches_invented })),
    'milliseconds of computing a second of recording', 'first contact of a patch, 95 % within [ms]', 1e-6);
  table('study', ['varied', '', 'ms a second', 'time', 'patches', 'missed', 'invented', 'median ms', '95 %', 'early', 'late', 'vertices', 'missed', 'invented', 'median ms', '95 %', 'early', 'late',
    'pairs tested'], rows.map(r => [r.varied, r.setting, short(r.ms_per_s), percent(r.share_of_time), ...['patches', 'vertices'].flatMap(of =>
      ['touched', 'missed', 'invented', 'median_ms', 'p95_ms', 'early_ms', 'late_ms'].map(what => r[of + '_' + what])),
      percent(r.pairs_share)])); }
