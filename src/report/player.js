// The player: recorded frames in 3-D with their contacts and patches. Nothing is interpolated; what is shown was recorded.
const player = (() => {
  const get = id => document.getElementById(id), note = get('player_note');
  if (typeof THREE === 'undefined') {
    note.textContent = 'This report has no player: it was made by a build without three.js (Debian: libjs-three).';
    return null;
  }
  const D = JSON.parse(get('player_data').textContent);
  if (!D.frames.length) { note.textContent = 'There is nothing to play: no step was answered.'; return null; }
  // Positions of all frames, whole quanta, decoded once.
  const frames = (() => {
    const binary = atob(D.bytes), out = [];
    let at = 0, last = null;
    const next = () => { let value = 0, shift = 0, b; do { b = binary.charCodeAt(at++); value |= (b & 127) << shift; shift += 7; } while (b & 128);
      return (value >>> 1) ^ -(value & 1); };
    for (const [from, to, step, shapes, details] of D.frames) {
      const places = shapes.map((shape, b) => {
        if (shape < 0) return null;
        const before = last && last.places[b], how = binary.charCodeAt(at++);
        if (how === 0) return before;
        const n = 3 * D.shapes[shape].vertices, q = new Int32Array(n);
        for (let i = 0; i < n; ++i) q[i] = (how === 1 ? before[i] : 0) + next();
        return q;
      });
      last = { from, to, step, shapes, details, places };
      out.push(last);
    }
    return out;
  })();
  const START = frames[0].to, END = frames[frames.length - 1].to, canvas = get('canvas'), view = get('view');
  // For a software renderer smooth edges and thin lines cost most of a frame: it gets none of the first, and the second
  // only while nothing plays.
  const isSoftware = (() => { const gl = document.createElement('canvas').getContext('webgl'), info = gl && gl.getExtension('WEBGL_debug_renderer_info');
    return !!info && /swiftshader|llvmpipe|software/i.test(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)); })();
  let renderer;
  try { renderer = new THREE.WebGLRenderer({ canvas, antialias: !isSoftware }); } catch (e) {
    note.textContent = 'The player needs WebGL, which this browser does not give: ' + e.message;
    return null;
  }
  view.hidden = get('controls').hidden = get('listing').hidden = false;
  const scheme = window.matchMedia('(prefers-color-scheme: dark)'), ground = () => renderer.setClearColor(getComputedStyle(view).backgroundColor);
  ground(); scheme.addEventListener('change', () => { ground(); draw(); });
  const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40, 16 / 9, 0.001, 1000);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.AmbientLight(0xffffff, 0.55));
  const lamp = new THREE.DirectionalLight(0xffffff, 0.6);
  camera.add(lamp); scene.add(camera);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.addEventListener('change', () => draw());

  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const COLOURS = [0x6fa8dc, 0x93c47d, 0xc9a0dc, 0x76c7c0, 0xd5c08a, 0x9aa9e0, 0xb5d36b, 0xd690b0, 0x5f9ea0, 0xbfa58f, 0xe3cdea, 0x4f9d69];
  const shown = D.bodies.map((body, b) => {
    const group = new THREE.Group(); scene.add(group);
    return { body, group, shape: -1, colour: COLOURS[b % COLOURS.length] };
  });
  function build(s, shape) {  // a body's triangles and edges; again only where its shape changes
    s.group.children.slice().forEach(c => { s.group.remove(c); c.geometry.dispose(); c.material.dispose(); });
    s.shape = shape;
    const { vertices, faces, edges } = D.shapes[shape];
    s.position = new THREE.BufferAttribute(new Float32Array(3 * vertices), 3);
    s.edges = edges || [...new Set(faces.flatMap(([a, b, c]) => [[a, b], [b, c], [c, a]].map(([i, j]) => Math.min(i, j) * vertices + Math.max(i, j))))]
      .map(k => [Math.floor(k / vertices), k % vertices]);
    const lines = new THREE.BufferGeometry(); lines.setAttribute('position', s.position);
    s.lines = new THREE.LineSegments(lines, new THREE.LineBasicMaterial(faces ? { color: 0x10151b, transparent: true, opacity: 0.35 } : { color: s.colour }));
    s.lines.frustumCulled = false; s.group.add(s.lines);
    s.lines.visible = !faces || !isSoftware || !playing;
    s.surface = null;
    if (faces) {
      const g = new THREE.BufferGeometry(); g.setAttribute('position', s.position);
      s.surface = new THREE.Mesh(g, new THREE.MeshLambertMaterial({ color: s.colour, side: THREE.DoubleSide,
        polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }));
      s.surface.frustumCulled = false; s.group.add(s.surface);
    }
    if (!faces) {  // a line is one pixel wide whatever is asked for; beads make a rope visible
      const beads = new THREE.Points(lines, new THREE.PointsMaterial({ color: s.colour, size: 5 * ratio, sizeAttenuation: false }));
      beads.frustumCulled = false; s.group.add(beads);
    }
    s.whole = null;
  }
  function place(s, shape, quanta) {
    s.group.visible = shape >= 0;
    if (shape < 0) return;
    if (shape !== s.shape) build(s, shape);
    if (s.quanta === quanta && s.whole !== null) return;
    s.quanta = quanta;
    const p = s.position.array, { quantum, origin } = s.body;
    let whole = true;
    for (let i = 0; i < p.length; ++i) { if (quanta[i] === D.not_finite) whole = false; p[i] = origin[i % 3] + quantum * quanta[i]; }
    s.position.needsUpdate = true;
    if (!whole || !s.whole) index(s, shape, quanta, whole);
    if (s.surface) s.surface.geometry.computeVertexNormals();
  }
  function index(s, shape, quanta, whole) {  // features on a vertex without a position are not drawn
    s.whole = whole;
    const known = v => whole || ![0, 1, 2].some(k => quanta[3 * v + k] === D.not_finite);
    const flat = list => list.filter(f => f.every(known)).reduce((all, f) => { all.push(...f); return all; }, []);
    s.lines.geometry.setIndex(flat(s.edges));
    if (s.surface) s.surface.geometry.setIndex(flat(D.shapes[shape].faces));
  }

  // The faces of voxels that no voxel of the same size hides.
  const SIDES = [0, 1, 2].flatMap(axis => [0, 1].map(up => ({ axis, up, at: [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]].map(([u, v]) => {
    const p = [0, 0, 0]; p[axis] = up; p[(axis + 1) % 3] = up ? u : v; p[(axis + 2) % 3] = up ? v : u; return p; }) })));
  const OBSTACLE = 0xb0a698, OWN = 0x59a673, DOUBTED = 0xf2bf33;
  const maps = D.maps.map(m => {
    const r = m.resolution, f = m.matrix, group = new THREE.Group();
    const turn = p => [0, 1, 2].map(i => f[4 * i] * p[0] + f[4 * i + 1] * p[1] + f[4 * i + 2] * p[2]), move = p => turn(p).map((v, i) => v + f[4 * i + 3]);
    const add = (list, colour, opacity, solid) => {
      const key = (x, y, z, size) => ((x * 65536 + y) * 65536 + z) * 20 + Math.log2(size), there = new Set(), points = [], normals = [], lines = [];
      for (let i = 0; i < list.length; i += 4) there.add(key(...list.slice(i, i + 4)));
      for (let i = 0; i < list.length; i += 4) {
        const leaf = list.slice(i, i + 4), size = leaf[3];
        SIDES.forEach(({ axis, up, at }) => {
          const next = leaf.slice(); next[axis] += up ? size : -size;
          if (there.has(key(...next))) return;
          const normal = [0, 0, 0]; normal[axis] = up ? 1 : -1;
          const corners = at.map(p => move(p.map((v, k) => (leaf[k] + v * size - 32768) * r)));
          corners.forEach(c => { points.push(...c); normals.push(...turn(normal)); });
          lines.push(...corners[0], ...corners[1], ...corners[1], ...corners[2]);
        });
      }
      const g = new THREE.BufferGeometry(), h = new THREE.BufferGeometry(), values = list => new THREE.BufferAttribute(new Float32Array(list), 3);
      g.setAttribute('position', values(points)); g.setAttribute('normal', values(normals)); h.setAttribute('position', values(lines));
      // First the depth of what is nearest, then that alone in colour: a solid, and not all its walls behind each other. Bodies are
      // drawn before it, so that one in a crack or below a table shines through.
      const behind = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }, part = (object, order) => { object.renderOrder = order; group.add(object); return object; };
      if (solid) part(new THREE.Mesh(g, new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true, ...behind })), 0);
      part(new THREE.Mesh(g, new THREE.MeshLambertMaterial({ color: colour, transparent: true, opacity, depthWrite: false, ...behind })), 1);
      return part(new THREE.LineSegments(h, new THREE.LineBasicMaterial({ color: new THREE.Color(colour).multiplyScalar(0.7), transparent: true, opacity: solid ? 0.6 : 0.5, depthWrite: false })), 2);
    };
    const edges = [[m.leaves, OBSTACLE, 0.8, true], [m.own || [], OWN, 0.25], [m.doubted || [], DOUBTED, 0.4]].filter(([list]) => list.length).map(all => add(...all));
    group.visible = false; scene.add(group);
    return { from: m.from, cubes: group, edges };
  });

  // Points on top of everything: discs for contacts, rings for patches.
  const sprite = ring => { const c = document.createElement('canvas'), g = c.getContext('2d'); c.width = c.height = 64;
    g.beginPath(); g.arc(32, 32, ring ? 24 : 26, 0, 7); g.lineWidth = ring ? 14 : 6;
    g.fillStyle = '#fff'; if (!ring) g.fill(); g.strokeStyle = '#10151b'; g.stroke();
    if (ring) { g.lineWidth = 8; g.strokeStyle = '#fff'; g.stroke(); }
    return new THREE.CanvasTexture(c); };
  const dots = (ring, size) => { const p = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size, sizeAttenuation: false,
    map: sprite(ring), vertexColors: THREE.VertexColors || true, transparent: true, depthTest: false, depthWrite: false }));
    p.frustumCulled = false; p.renderOrder = ring ? 4 : 3; scene.add(p); return p; };
  const contactDots = dots(false, 11 * ratio), patchDots = dots(true, 22 * ratio), pickedDot = dots(true, 34 * ratio);
  const rgb = text => text.match(/\d+/g).map(v => v / 255);
  function fill(points, list) {
    points.geometry.dispose();
    const g = points.geometry = new THREE.BufferGeometry();
    g.setAttribute('position', new THREE.BufferAttribute(new Float32Array(list.flatMap(i => i.at)), 3));
    g.setAttribute('color', new THREE.BufferAttribute(new Float32Array(list.flatMap(i => i.rgb)), 3));
    points.visible = list.length > 0;
  }
  const MUTED = [0.66, 0.7, 0.74], KIND = ['vertex against face', 'edge against edge', 'vertex against voxel face', 'edge against voxel edge', 'face against voxel corner'];
  const name = b => b === 65535 ? 'octomap' : D.bodies[b] ? D.bodies[b].name : String(b);
  const seconds = t => t.toFixed(6) + ' s';
  // Names of vertices by feature: what belongs to the first partner, what to the second.
  const features = (kind, v, b0, b1, voxel) => { const first = [1, 2, 1, 2, 3][kind], part = (b, list) => name(b) + (list.length > 1 ? ' vertices ' : ' vertex ') + list.join(' ');
    return part(b0, v.slice(0, first)) + ' and ' + (voxel ? `octomap voxel ${voxel.slice(0, 3).join(' ')}` + (voxel[3] > 1 ? `, ${voxel[3]} voxels wide` : '') : part(b1, v.slice(first))); };
  const digits = x => +x.toPrecision(12);
  const interval = (f, low, high) => low === high ? `at ${digits(low)} of the step, ${seconds(f.from + low * (f.to - f.from))} after the start` :
    `between ${digits(low)} and ${digits(high)} of the step, from ${seconds(f.from + low * (f.to - f.from))} after the start, ${((high - low) * (f.to - f.from)).toExponential(1)} s wide`;
  function items(f) {
    if (!f.details) return [];
    const contacts = f.details.c.map(([kind, b0, b1, v, flags, low, high, at, patch, voxel]) => {
      const is = bit => (flags & bit) !== 0;
      const states = [is(1) ? 'certain' : 'undecided', is(2) ? 'there when the step began' : 'new', is(4) && 'leaving', is(8) && 'expected'].filter(Boolean);
      return { kind: 'contact', at, rgb: is(8) ? MUTED : rgb(early(low)), title: features(kind, v, b0, b1, voxel) + (is(2) ? ', there when the step began' : ''),
        text: `Contact, ${KIND[kind]}: ${features(kind, v, b0, b1, voxel)}; ${states.join(', ')}. Time of contact ${interval(f, low, high)}.` + (patch ? ` Part of patch ${patch}.` : '') };
    });
    const patches = f.details.p.map(([id, b0, b1, beginning, n, crossings, expected, low, high, area, at, normal, from, to]) => {
      const began = to === null ? 'When it began is not known.' : from === null ? `It began at or before ${seconds(to)}.` : `It began between ${seconds(from)} and ${seconds(to)}.`;
      const since = to === null ? f.from : to, whole = expected >= n + crossings;
      return { kind: 'patch', at, rgb: whole ? MUTED : rgb(byTime(since)), title: `patch${id ? ' ' + id : ''}: ${b0 === b1 ? name(b0) + ' with itself' : name(b0) + ' with ' + name(b1)}`,
        text: `Patch${id ? ' ' + id : ''} of ${name(b0)} and ${b0 === b1 ? 'itself' : name(b1)} (${beginning}): ${n} contacts` + (crossings ? `, ${crossings} edges through faces` : '') + (expected ? `, ${expected} of them expected` : '') +
          (area ? `, ${area.toPrecision(3)} m²` : '') + `. First touch in this step ${interval(f, low, high)}. ${began}` };
    });
    return contacts.concat(patches);
  }
  let current = -1, listed = [], chosen = null, playing = false, clock = START, before = 0, drawn = 0, pending = false;
  const paint = () => { pending = false; ++drawn; renderer.render(scene, camera); };
  const draw = () => { if (!pending) { pending = true; requestAnimationFrame(() => pending && paint()); } };
  function choose(item) {
    chosen = item;
    get('picked').textContent = item ? item.text : 'Click a contact or a patch to see what it is.';
    fill(pickedDot, item ? [{ at: item.at, rgb: [1, 1, 1] }] : []);
    draw();
  }
  function list() {
    const ul = get('listed'); ul.textContent = '';
    listed.forEach(item => { const b = ul.appendChild(document.createElement('li')).appendChild(document.createElement('button'));
      b.textContent = item.title; b.style.borderLeft = `.6rem solid rgb(${item.rgb.map(v => Math.round(255 * v)).join(',')})`; b.addEventListener('click', () => choose(item)); });
  }
  function show(i, t) {
    clock = t;
    if (i !== current) move(i);
    if (!playing || performance.now() - told > TELL_MS) tell();
  }
  function move(i) {
    if (chosen || current < 0) choose(null);
    current = i;
    const f = frames[i];
    shown.forEach((s, b) => place(s, b < f.shapes.length ? f.shapes[b] : -1, f.places[b]));
    let of = -1; maps.forEach((m, k) => { if (m.from <= f.to + 1e-9) of = k; });
    maps.forEach((m, k) => { m.cubes.visible = k === of; });
    listed = items(f);
    fill(contactDots, listed.filter(x => x.kind === 'contact'));
    fill(patchDots, listed.filter(x => x.kind === 'patch'));
    draw();
  }
  // In words, and on the lanes: to lay the page out anew for each frame that is played would cost more than the frame.
  const TELL_MS = 200;
  let told = 0, toldOf = -1;
  function tell() {
    told = performance.now();
    get('seek').value = clock; get('clock').textContent = clock.toFixed(3) + ' s';
    lanes.cursor(clock);
    if (toldOf === current) return;
    toldOf = current;
    const f = frames[current], d = f.details, more = d && d.n > d.c.length ? ` (${d.c.length} shown, the others are in contacts.csv)` : '';
    get('now').textContent = !d ? `Where the bodies were at ${seconds(f.to)}, when a step began.` :
      `Step ${f.step}, which ended at ${seconds(f.to)}: ${d.n} contact${d.n === 1 ? '' : 's'}${more}, ${d.np} patch${d.np === 1 ? '' : 'es'}.`;
    get('listing').querySelector('summary').textContent = `Contacts and patches of this frame (${listed.length})`;
    if (get('listing').open) list();
  }
  get('listing').addEventListener('toggle', () => get('listing').open && list());
  // The step that holds the time; between the frames that were kept, the one before.
  function frameAt(t) {
    let low = 0, high = frames.length - 1;
    while (low < high) { const mid = (low + high + 1) >> 1; if (frames[mid].to <= t + 1e-9) low = mid; else high = mid - 1; }
    return low + 1 < frames.length && frames[low].to < t - 1e-9 && frames[low + 1].from < t && frames[low + 1].details ? low + 1 : low;
  }
  const seek = t => { t = Math.min(END, Math.max(START, t)); show(frameAt(t), t); };
  const setPlaying = on => {
    playing = on;
    get('play').textContent = on ? 'Pause' : 'Play';
    if (!on) tell();
    if (!isSoftware) return;
    shown.forEach(s => { if (s.surface) s.lines.visible = !on; });
    maps.forEach(m => m.edges.forEach(e => { e.visible = !on; }));
    draw();
  };
  const stop = () => setPlaying(false);
  function go(now) {
    if (!playing) return;
    if (before) { seek(clock + (now - before) / 1000 * +get('speed').value); if (clock >= END) return stop(); }
    before = now;
    pending = true; paint();
    requestAnimationFrame(go);
  }
  get('play').addEventListener('click', () => {
    if (playing) return stop();
    if (clock >= END) seek(START);
    before = 0; setPlaying(true); requestAnimationFrame(go); });
  const stepTo = i => { stop(); i = Math.min(frames.length - 1, Math.max(0, i)); show(i, frames[i].to); };
  get('back').addEventListener('click', () => stepTo(current - 1));
  get('on').addEventListener('click', () => stepTo(current + 1));
  get('seek').min = START; get('seek').max = END;
  get('seek').addEventListener('input', e => { const t = +e.target.value; stop(); seek(t); });
  lanes.seek = t => { stop(); seek(t); };

  function screenOf(item) {
    const p = new THREE.Vector3(...item.at).project(camera), box = canvas.getBoundingClientRect();
    return [box.left + (p.x + 1) / 2 * box.width, box.top + (1 - p.y) / 2 * box.height];
  }
  let down = null;
  canvas.addEventListener('pointerdown', e => { down = [e.clientX, e.clientY]; });
  canvas.addEventListener('pointerup', e => {
    if (!down || Math.hypot(e.clientX - down[0], e.clientY - down[1]) > 4) return;
    camera.updateMatrixWorld();
    let best = 14, item = null;  // pixels
    listed.forEach(x => { const [px, py] = screenOf(x), d = Math.hypot(px - e.clientX, py - e.clientY); if (d < best) { best = d; item = x; } });
    choose(item); });

  function fit() {  // where the bodies that move are while something touches; only still ones: those
    const touching = frames.filter(f => f.details && f.details.n), taken = touching.length ? touching : frames;
    const sample = all => shown.flatMap((s, b) => {
      const places = taken.map(f => f.places[b]).filter(Boolean), points = [];
      if (!places.length || (!all && places.every(p => p === places[0]))) return points;
      const every = Math.max(1, Math.floor(places.length / 50));
      places.filter((_, i) => i % every === 0).forEach(q => { const skip = 3 * Math.max(1, Math.floor(q.length / 900));
        for (let i = 0; i < q.length; i += skip) if (q[i] !== D.not_finite)
          points.push(new THREE.Vector3(...[0, 1, 2].map(k => s.body.origin[k] + s.body.quantum * q[i + k]))); });
      return points; });
    let points = sample(false); if (!points.length) points = sample(true);
    const centre = points.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(Math.max(points.length, 1));
    // So near that nearly all of it is seen, with a margin: each point asks for a distance.
    const back = new THREE.Vector3(-0.55, -0.75, 0.45).normalize(), right = new THREE.Vector3(0, 0, 1).cross(back).normalize(), up = back.clone().cross(right);
    const along = axis => { const v = points.map(p => p.clone().sub(centre).dot(axis)).sort((a, b) => a - b); return (v[0] + v[v.length - 1]) / 2 || 0; };
    const aside = [right, up].map(axis => [axis, along(axis)]); aside.forEach(([axis, by]) => centre.addScaledVector(axis, by));
    const tall = 0.88 * Math.tan(camera.fov * Math.PI / 360), wide = tall * camera.aspect;
    const asked = points.map(p => { const q = p.clone().sub(centre); return q.dot(back) + Math.max(Math.abs(q.dot(right)) / wide, Math.abs(q.dot(up)) / tall); }).sort((a, b) => a - b);
    const away = Math.max(asked[Math.floor(0.995 * (asked.length - 1))] || 0, 1e-5);
    camera.near = away / 200; camera.far = away * 50; camera.updateProjectionMatrix();
    camera.position.copy(centre).addScaledVector(back, away);
    controls.target.copy(centre); controls.update();
  }
  get('fit').addEventListener('click', fit);
  function resize() {
    const width = view.clientWidth, height = Math.max(220, Math.round(Math.min(width * 9 / 16, 620)));
    renderer.setPixelRatio(ratio); renderer.setSize(width, height);
    camera.aspect = width / height; camera.updateProjectionMatrix(); draw();
  }
  window.addEventListener('resize', resize);
  resize(); fit();
  const legend = get('legend');
  const item = (...parts) => { const li = legend.appendChild(document.createElement('li')); li.append(...parts); return li; };
  [['● contact, within its step: early', early], ['○ patch, within the run: early', inRun]].forEach(([text, times]) => { const bar = document.createElement('span');
    bar.className = 'scale'; bar.style.background = gradient(times); item(text, bar, 'late'); });
  item('● ○ grey: expected');
  const swatch = (colour, text) => { const i = document.createElement('i'); i.style.background = '#' + colour.toString(16).padStart(6, '0'); item(i, text); };
  const NAMED = 8;  // a robot has many links
  shown.slice(0, NAMED).forEach(s => swatch(s.colour, s.body.name));
  if (shown.length > NAMED) item(`and ${shown.length - NAMED} more bodies`);
  if (D.maps.some(m => m.own)) swatch(OWN, "a body's own voxels, no obstacle");
  if (D.maps.some(m => m.doubted)) swatch(DOUBTED, "voxels in doubt, a body's or an obstacle's");
  note.textContent = (frames.length < D.seen ? `${frames.length} of ${D.seen} recorded frames are kept, those with events of patches first: what is between is not shown. ` :
    `All ${D.seen} recorded frames. `) + 'Nothing is interpolated. Positions are rounded for display, to ' +
    `${Math.max(0, ...D.bodies.map(b => b.quantum || 0)).toExponential(1)} m or finer. At most ${D.most_contacts} contacts of a frame are drawn, new ones first.` +
    (D.maps.some(m => !m.all) ? ' Of the map the voxels next to the bodies are drawn.' : D.maps.length ? ' Of the map the voxels near the bodies are drawn.' : '') +
    (D.maps_left_out ? ` ${D.maps_left_out} later changes of the map are not drawn.` : '') + ' Drag to turn, wheel to zoom, right button to move.';
  const firsts = R.partners.filter(p => p.first).map(p => p.first.t);
  seek(firsts.length ? Math.min(...firsts) : START);
  return { seek, paint, frames, items: () => listed, screenOf: i => screenOf(listed[i]), drawn: () => drawn, time: () => clock };
})();
