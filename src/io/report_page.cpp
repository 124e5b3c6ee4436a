#include <string>

#include "io/report.h"

namespace deformable_ccd {
namespace {

const char* const HEAD = R"PAGE(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>deformable_ccd report</title>
<style>
body { font: 15px/1.45 system-ui, sans-serif; color: #1c2430; margin: 2rem auto; max-width: 1080px; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: .2rem; } h2 { font-size: 1.1rem; margin: 2rem 0 .4rem; }
p.lead { font-size: 1.1rem; background: #eef3f8; border-left: 4px solid #2a6fb0; padding: .6rem .9rem; }
table { border-collapse: collapse; font-size: .9rem; } td, th { padding: .2rem .7rem; border-bottom: 1px solid #dde3ea; text-align: right; }
td:first-child, th:first-child, td.text, th.text { text-align: left; } th { color: #556; font-weight: 600; }
svg { display: block; background: #fff; border: 1px solid #dde3ea; max-width: 100%; } .note { color: #556; font-size: .88rem; }
canvas { border: 1px solid #dde3ea; max-width: 100%; } .bad { color: #b3261e; }
</style></head><body>
<h1>Contacts of a recorded run</h1><p class="lead" id="headline"></p><table id="facts"></table>
<h2>Contacts over time</h2><div id="contacts"></div>
<p class="note">Each bar is a step: contacts, of them undecided (orange) and initial (grey). Red bands: frames without an answer; "no
answer" is never "no contact".</p>
<h2>Earliest time of contact within each step</h2><div id="toc"></div>
<p class="note">0 is the beginning of the step, 1 its end.</p>
<h2>Where on the bodies</h2><div id="heat"></div>
<p class="note">Contacts per vertex on the body's own layout in the first answered frame; grey means never.</p>
<h2>Frames without an answer, seams</h2><table id="seams"></table>
<h2>Where the time goes</h2><table id="stages"></table><h3 style="font-size:1rem">Milliseconds per step</h3><div id="latency"></div>
<h2>Effects</h2><table id="effects"></table>
<h2>What accuracy costs on this recording</h2><table id="rungs"></table>
<h2>Tiers of the exact test</h2><table id="tiers"></table>
<script>const R = )PAGE";

const char* const TAIL = R"PAGE(;
const NS = 'http://www.w3.org/2000/svg';
const el = (n, a, parent, text) => { const e = document.createElementNS(NS, n); for (const k in a) e.setAttribute(k, a[k]);
  if (text !== undefined) e.textContent = text; if (parent) parent.appendChild(e); return e; };
const number = x => x === null || x === undefined ? '–' : Number.isInteger(x) ? x.toLocaleString('en') : Math.abs(x) >= 1e-3 || x === 0 ? x.toFixed(3) : x.toExponential(1);
function table(id, head, rows) {
  const t = document.getElementById(id);
  if (!rows.length) { t.outerHTML = '<p class="note">None.</p>'; return; }
  const add = (cells, tag) => { const tr = t.insertRow(); cells.forEach(c => { const d = document.createElement(tag);
    d.textContent = typeof c === 'string' ? c : number(c); if (typeof c === 'string') d.className = 'text'; tr.appendChild(d); }); };
  if (head) add(head, 'th');
  rows.forEach(r => add(r, 'td'));
}
function axes(id, height, ymax, ylabel) {
  const W = 1040, L = 62, B = 34, T = 10, steps = R.steps, t0 = steps.length ? steps[0].t : 0;
  const t1 = steps.length > 1 ? steps[steps.length - 1].t : t0 + 1, span = Math.max(t1 - t0, 1e-9);
  const svg = el('svg', { viewBox: `0 0 ${W} ${height}`, width: W, height }, document.getElementById(id));
  const x = t => L + (W - L - 12) * (t - t0) / span, y = v => height - B - (height - B - T) * v / ymax;
  steps.forEach((s, i) => { if (s.answered) return; const w = Math.max(2, (W - L - 12) / steps.length);
    el('rect', { x: x(s.t) - w / 2, y: T, width: w, height: height - B - T, fill: '#f6c9c5' }, svg).appendChild(el('title', {}, null, s.status + ': ' + s.reason)); });
  for (let i = 0; i <= 4; ++i) { const v = ymax * i / 4;
    el('line', { x1: L, x2: W - 12, y1: y(v), y2: y(v), stroke: '#e3e8ee' }, svg);
    el('text', { x: L - 6, y: y(v) + 4, 'text-anchor': 'end', 'font-size': 12, fill: '#556' }, svg, number(+v.toPrecision(3)));
    const t = t0 + span * i / 4;
    el('text', { x: x(t), y: height - B + 18, 'text-anchor': i == 4 ? 'end' : i ? 'middle' : 'start', 'font-size': 12, fill: '#556' }, svg, number(+t.toFixed(3)) + ' s'); }
  el('text', { x: 14, y: height / 2, 'font-size': 12, fill: '#556', transform: `rotate(-90 14 ${height / 2})`, 'text-anchor': 'middle' }, svg, ylabel);
  return { svg, x, y, bar: Math.max(1.5, 0.8 * (W - L - 12) / Math.max(steps.length, 1)) };
}
document.getElementById('headline').textContent = R.headline;
table('facts', null, R.facts);
{ const most = Math.max(1, ...R.steps.map(s => s.contacts)), a = axes('contacts', 240, most, 'contacts');
  R.steps.forEach(s => { if (!s.contacts) return;
    [[s.contacts, '#2a6fb0'], [s.undecided + s.initial, '#f0a030'], [s.initial, '#9aa4b0']].forEach(([n, fill]) => { if (n)
      el('rect', { x: a.x(s.t) - a.bar / 2, y: a.y(Math.min(n, s.contacts)), width: a.bar, height: a.y(0) - a.y(Math.min(n, s.contacts)), fill }, a.svg)
        .appendChild(el('title', {}, null, `step ${s.step}: ${s.contacts} contacts, ${s.undecided} undecided, ${s.initial} initial`)); }); }); }
{ const a = axes('toc', 180, 1, 'earliest TOC');
  R.steps.forEach(s => { if (s.toc === null || s.toc > 1) return;
    el('circle', { cx: a.x(s.t), cy: a.y(s.toc), r: 2.6, fill: '#2a6fb0' }, a.svg).appendChild(el('title', {}, null, `step ${s.step}: ${s.toc}`)); }); }
{ const a = axes('latency', 180, Math.max(1e-3, ...R.steps.map(s => s.ms)), 'ms');
  el('polyline', { points: R.steps.filter(s => s.answered).map(s => `${a.x(s.t)},${a.y(s.ms)}`).join(' '), fill: 'none', stroke: '#2a6fb0', 'stroke-width': 1.3 }, a.svg); }
const colour = f => { const stops = [[255, 236, 179], [251, 140, 60], [183, 28, 28]], i = Math.min(1, Math.floor(f * 2)), w = f * 2 - i;
  return 'rgb(' + stops[i].map((c, k) => Math.round(c + w * (stops[i + 1][k] - c))).join(',') + ')'; };
R.bodies.forEach(b => {
  const box = document.getElementById('heat'), most = Math.max(0, ...b.count), title = document.createElement('p');
  title.textContent = `${b.name}: ${b.xy.length} vertices, ${b.count.filter(c => c).length} of them in contact at some time, at most ${most} times`;
  box.appendChild(title);
  const xs = b.xy.map(p => p[0]), ys = b.xy.map(p => p[1]);
  let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
  xs.forEach(v => { x0 = Math.min(x0, v); x1 = Math.max(x1, v); }); ys.forEach(v => { y0 = Math.min(y0, v); y1 = Math.max(y1, v); });
  const W = 640, s = (W - 20) / Math.max(x1 - x0, 1e-9), H = Math.min(640, Math.max(24, s * (y1 - y0) + 20));
  const c = document.createElement('canvas'); c.width = W; c.height = H; box.appendChild(c);
  const g = c.getContext('2d'), px = i => 10 + s * (xs[i] - x0), py = i => H - 10 - s * (ys[i] - y0);
  const shade = n => n > 0 ? colour(Math.log(1 + n) / Math.log(1 + most)) : '#e4e8ec';
  b.faces.forEach(f => { g.beginPath(); f.forEach((v, k) => k ? g.lineTo(px(v), py(v)) : g.moveTo(px(v), py(v))); g.closePath();
    g.fillStyle = shade((b.count[f[0]] + b.count[f[1]] + b.count[f[2]]) / 3); g.fill(); g.strokeStyle = 'rgba(90,100,110,.25)'; g.lineWidth = .5; g.stroke(); });
  (b.edges || []).forEach(e => { g.beginPath(); g.moveTo(px(e[0]), py(e[0])); g.lineTo(px(e[1]), py(e[1]));
    g.strokeStyle = shade(Math.max(b.count[e[0]], b.count[e[1]])); g.lineWidth = 3; g.stroke(); });
});
table('seams', ['time [s]', 'step', 'status', 'reason'], R.steps.filter(s => s.status !== 'OK').slice(0, 500).map(s => [number(s.t), String(s.step), s.status, s.reason]));
table('stages', ['stage', 'pairs in', 'pairs out', 'median ms', '95 % ms'],
  R.stages.map(s => [s.name, s.in, s.out, s.median_ms, s.p95_ms]).concat([['whole step', '', '', R.total.median_ms, R.total.p95_ms]]));
table('effects', ['effect', 'runs', 'why', 'pairs in', 'pairs out', 'ms'], R.effects.map(e => [e.name, e.running ? 'yes' : 'no', e.reason, e.in, e.out, e.ms]));
table('rungs', ['rung', 'steps', 'contacts reported', 'missed', 'false', 'undecided', 'worst TOC error', 'median ms', '95 % ms'],
  R.rungs.map(r => [r.rung, r.steps, r.contacts, r.missed, r.false, r.undecided, r.max_toc_error, r.median_ms, r.p95_ms]));
table('tiers', ['tier', 'pairs settled'], Object.entries(R.tiers));
</script></body></html>
)PAGE";

}  // namespace

std::string reportPage(const std::string& data) { return HEAD + data + TAIL; }

}  // namespace deformable_ccd
