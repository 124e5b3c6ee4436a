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
  let renderer;
  try { renderer = new THREE.WebGLRenderer({ canvas, antialias: true }); } catch (e) {
    note.textContent = 'The player needs WebGL, which this browser does not give: ' + e.message;
    return null;
  }
  view.hidden = get('controls').hidden = get('listing').hidden = false;
  renderer.setClearColor(0x20262e);
  const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40, 16 / 9, 0.001, 1000);
  camera.up.set(0, 0, 1);
  scene.add(new THREE.AmbientLight(0xffffff, 0.55));
  const lamp = new THREE.DirectionalLight(0xffffff, 0.6);
  camera.add(lamp); scene.add(camera);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.addEventListener('change', () => draw());

  const COLOURS = [0x6fa8dc, 0x93c47d, 0xc9a0dc, 0x76c7c0, 0xd5c08a, 0x9aa9e0];
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
    s.surface = null;
    if (faces) {
      const g = new THREE.BufferGeometry(); g.setAttribute('position', s.position);
      s.surface = new THREE.Mesh(g, new THREE.MeshPhongMaterial({ color: s.colour, side: THREE.DoubleSide, flatShading: true, shininess: 5,
        polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }));
      s.surface.frustumCulled = false; s.group.add(s.surface);
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
    if (whole && s.whole) return;
    s.whole = whole;  // features on a vertex without a position are not drawn
    const known = v => whole || ![0, 1, 2].some(k => quanta[3 * v + k] === D.not_finite);
    const flat = list => list.filter(f => f.every(known)).reduce((all, f) => { all.push(...f); return all; }, []);
    s.lines.geometry.setIndex(flat(s.edges));
    if (s.surface) s.surface.geometry.setIndex(flat(D.shapes[shape].faces));
  }

  const maps = D.maps.map(m => {
    const n = m.leaves.length / 4, cubes = new THREE.InstancedMesh(new THREE.BoxBufferGeometry(1, 1, 1),
      new THREE.MeshPhongMaterial({ color: 0x8a8378, shininess: 0, flatShading: true }), Math.max(n, 1));
    const r = m.resolution, one = new THREE.Matrix4(), f = m.matrix;
    const fixed = new THREE.Matrix4().set(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], 0, 0, 0, 1);
    for (let i = 0; i < n; ++i) {
      const [x, y, z, size] = m.leaves.slice(4 * i, 4 * i + 4), half = size / 2, side = size * r * 0.985;  // a seam between voxels
      one.makeScale(side, side, side).setPosition((x + half - 32768) * r, (y + half - 32768) * r, (z + half - 32768) * r);
      cubes.setMatrixAt(i, one.premultiply(fixed));
    }
    cubes.count = n; cubes.frustumCulled = false; cubes.visible = false;
    scene.add(cubes);
    return { from: m.from, cubes };
  });

  // Points on top of everything: discs for contacts, rings for patches.
  const sprite = ring => { const c = document.createElement('canvas'), g = c.getContext('2d'); c.width = c.height = 64;
    g.beginPath(); g.arc(32, 32, ring ? 24 : 26, 0, 7); g.lineWidth = ring ? 10 : 6;
    g.fillStyle = '#fff'; if (!ring) g.fill(); g.strokeStyle = ring ? '#fff' : '#10151b'; g.stroke();
    return new THREE.CanvasTexture(c); };
  const dots = (ring, size) => { const p = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size, sizeAttenuation: false,
    map: sprite(ring), vertexColors: THREE.VertexColors || true, transparent: true, depthTest: false, depthWrite: false }));
    p.frustumCulled = false; p.renderOrder = ring ? 2 : 1; scene.add(p); return p; };
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
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
  const interval = (f, low, high) => low === high ? `at ${low} of the step, ${seconds(f.from + low * (f.to - f.from))} after the start` :
    `between ${low} and ${high} of the step, from ${seconds(f.from + low * (f.to - f.from))} after the start, ${((high - low) * (f.to - f.from)).toExponential(1)} s wide`;
  function items(f) {
    if (!f.details) return [];
    const contacts = f.details.c.map(([kind, b0, b1, v, flags, low, high, tier, at, patch, voxel]) => {
      const is = bit => (flags & bit) !== 0;
      const states = [is(1) ? 'certain' : 'undecided', is(2) ? 'there when the step began' : 'new', is(4) && 'leaving', is(8) && 'expected'].filter(Boolean);
      const settled = tier ? `Settled by tier ${tier}.` : D.rung && D.rung !== 'exact' ? `The rung ${D.rung} has no tiers.` :
        voxel ? 'Tiers are told for pairs of meshes.' : 'Its tier is not told: the pair alone does not tell how it was settled.';
      return { kind: 'contact', at, rgb: is(8) ? MUTED : rgb(colour(low)), title: `${name(b0)} and ${name(b1)}: ${KIND[kind]}`,
        text: `Contact, ${KIND[kind]}: ${features(kind, v, b0, b1, voxel)}. ${states.join(', ')}. Time of contact ${interval(f, low, high)}. ` + settled + (patch ? ` Part of patch ${patch}.` : '') };
    });
    const patches = f.details.p.map(([id, b0, b1, beginning, n, crossings, expected, low, high, area, at, normal, from, to]) => {
      const began = to === null ? 'When it began is not known.' : from === null ? `It began at or before ${seconds(to)}.` : `It began between ${seconds(from)} and ${seconds(to)}.`;
      const since = to === null ? f.from : to, whole = expected >= n + crossings;
      return { kind: 'patch', at, rgb: whole ? MUTED : rgb(byTime(since)), title: `patch${id ? ' ' + id : ''}: ${b0 === b1 ? name(b0) + ' with itself' : name(b0) + ' with ' + name(b1)}`,
        text: `Patch${id ? ' ' + id : ''} of ${name(b0)} and ${b0 === b1 ? 'itself' : name(b1)} (${beginning}): ${n} contacts` + (crossings ? `, ${crossings} edges through faces` : '') + (expected ? `, ${expected} of them expected` : '') +
          (area ? `, ${(1e4 * area).toPrecision(3)} cm²` : '') + `. First touch in this step ${interval(f, low, high)}. ${began}` };
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
    get('seek').value = t; get('clock').textContent = t.toFixed(3) + ' s';
    lanes.cursor(t);
    if (i === current) return;
    current = i;
    const f = frames[i];
    shown.forEach((s, b) => place(s, b < f.shapes.length ? f.shapes[b] : -1, f.places[b]));
    let of = -1; maps.forEach((m, k) => { if (m.from <= f.to + 1e-9) of = k; });
    maps.forEach((m, k) => { m.cubes.visible = k === of; });
    listed = items(f);
    fill(contactDots, listed.filter(x => x.kind === 'contact'));
    fill(patchDots, listed.filter(x => x.kind === 'patch'));
    choose(null);
    const d = f.details, more = d && d.n > d.c.length ? ` (${d.c.length} shown, the others are in contacts.csv)` : '';
    get('now').textContent = !d ? `Where the bodies were at ${seconds(f.to)}, when a step began.` :
      `Step ${f.step}, which ended at ${seconds(f.to)}: ${d.n} contact${d.n === 1 ? '' : 's'}${more}, ${d.np} patch${d.np === 1 ? '' : 'es'}.`;
    get('listing').querySelector('summary').textContent = `Contacts and patches of this frame (${listed.length})`;
    if (get('listing').open) list();
    draw();
  }
  get('listing').addEventListener('toggle', () => get('listing').open && list());
  // The step that holds the time; between the frames that were kept, the one before.
  function frameAt(t) {
    let low = 0, high = frames.length - 1;
    while (low < high) { const mid = (low + high + 1) >> 1; if (frames[mid].to <= t + 1e-9) low = mid; else high = mid - 1; }
    return low + 1 < frames.length && frames[low].to < t - 1e-9 && frames[low + 1].from < t && frames[low + 1].details ? low + 1 : low;
  }
  const seek = t => { t = Math.min(END, Math.max(START, t)); show(frameAt(t), t); };
  const stop = () => { playing = false; get('play').textContent = 'Play'; };
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
    playing = true; before = 0; get('play').textContent = 'Pause'; requestAnimationFrame(go); });
  const stepTo = i => { stop(); i = Math.min(frames.length - 1, Math.max(0, i)); show(i, frames[i].to); };
  get('back').addEventListener('click', () => stepTo(current - 1));
  get('on').addEventListener('click', () => stepTo(current + 1));
  get('seek').min = START; get('seek').max = END;
  get('seek').addEventListener('input', e => { stop(); seek(+e.target.value); });
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

  function fit() {  // all bodies that move, over all frames; only still ones: those
    const box = new THREE.Box3();
    const add = all => shown.forEach((s, b) => {
      const places = frames.map(f => f.places[b]).filter(Boolean);
      if (!places.length || (!all && places.every(p => p === places[0]))) return;
      const every = Math.max(1, Math.floor(places.length / 50));
      places.filter((_, i) => i % every === 0).forEach(q => { for (let i = 0; i < q.length; i += 3) if (q[i] !== D.not_finite)
        box.expandByPoint(new THREE.Vector3(...[0, 1, 2].map(k => s.body.origin[k] + s.body.quantum * q[i + k]))); }); });
    add(false); if (box.isEmpty()) add(true);
    const centre = box.getCenter(new THREE.Vector3()), radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 1e-6);
    const narrow = Math.min(1, camera.aspect), away = radius / Math.sin(camera.fov * Math.PI / 360) / narrow;
    camera.near = away / 200; camera.far = away * 50; camera.updateProjectionMatrix();
    camera.position.copy(centre).add(new THREE.Vector3(-0.55, -0.75, 0.45).normalize().multiplyScalar(away));
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
  const scale = (text, low, high) => { const p = legend.appendChild(document.createElement('span')), bar = document.createElement('span');
    bar.className = 'scale'; bar.style.background = GRADIENT; p.append(text + ' ' + low, bar, high); };
  scale('● contact, by its time in the step:', '0', '1');
  scale('○ patch, by when it began:', seconds(SPAN[0]).replace(/0+ s/, '0 s'), SPAN[1].toFixed(2) + ' s');
  legend.appendChild(document.createElement('span')).textContent = 'grey: expected';
  shown.forEach(s => { const p = legend.appendChild(document.createElement('span')), i = p.appendChild(document.createElement('i'));
    i.style.background = '#' + s.colour.toString(16).padStart(6, '0'); p.append(s.body.name); });
  note.textContent = (frames.length < D.seen ? `${frames.length} of ${D.seen} recorded frames are kept, those with events of patches first: what is between is not shown. ` :
    `All ${D.seen} recorded frames. `) + 'Nothing is interpolated. Positions are rounded for display, to ' +
    D.bodies.filter(b => b.quantum).map(b => `${(1e3 * b.quantum).toPrecision(2)} mm (${b.name})`).join(', ') + `. At most ${D.most_contacts} contacts of a frame are drawn, new ones first.` +
    (D.maps.some(m => !m.all) ? ' Of the map the voxels next to the bodies are drawn.' : D.maps.length ? ' Of the map the voxels near the bodies are drawn.' : '') +
    (D.maps_left_out ? ` ${D.maps_left_out} later changes of the map are not drawn.` : '') + ' Drag to turn, wheel to zoom, right button to move.';
  seek(START);
  return { seek, frames, items: () => listed, screenOf: i => screenOf(listed[i]), drawn: () => drawn, time: () => clock };
})();
