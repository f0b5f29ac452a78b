// The 3D replay: bodies, support polygon, COM, ZMP and forces, drawn from the page's own data.
(() => {
  "use strict";
  const element = document.getElementById("replay");
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const find = (name) => element.querySelector(`[data-part="${name}"]`);
  const COM = 0x0072b2;
  const ZMP = 0xd55e00;
  const SUPPORT = 0x009e73;
  const PUSH = 0xcc79a7;
  const TARGET = 0xe69f00;
  const SKY = 0xe8eef4;

  // ---- data ----------------------------------------------------------------------------------
  function bytes(text) {
    const raw = atob(text);
    const out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i += 1) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }
  const floats = (text) => new Float32Array(bytes(text));

  const time = floats(data.time);
  const position = floats(data.position);
  const quaternion = new Int16Array(bytes(data.quaternion));
  const com = floats(data.com);
  const zmp = floats(data.zmp);
  const forces = data.forces.map((f) => ({ ...f, point: floats(f.point), force: floats(f.force) }));
  const markers = data.markers.map((m) => ({ ...m, position: floats(m.position) }));
  const bodies = data.bodies;
  const last = time.length - 1;
  const start = time[0];
  const end = time[last];

  // ---- controls, which work without WebGL too ---------------------------------------------------
  const clock = window.poiseClock;
  const slider = find("slider");
  const play = find("play");
  const speed = find("speed");
  let playing = false;
  let before = 0;

  slider.min = start;
  slider.max = end;
  slider.step = "any";
  for (const event of data.events) {
    if (event.time < start || event.time > end || end <= start) continue;
    const tick = document.createElement("span");
    tick.className = "tick";
    tick.title = event.label;
    // The thumb's centre moves from half a thumb to the width less half a thumb.
    const share = (event.time - start) / (end - start);
    tick.style.left = `calc(8px + ${share} * (100% - 16px))`;
    find("track").append(tick);
  }

  function setPlaying(on) {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    if (on) {
      if (clock.time >= end) clock.set(start);
      before = performance.now();
      requestAnimationFrame(advance);
    }
  }
  function advance(now) {
    if (!playing) return;
    const next = clock.time + ((now - before) / 1000) * Number(speed.value);
    before = now;
    clock.set(Math.min(next, end));
    if (next >= end) setPlaying(false);
    else requestAnimationFrame(advance);
  }
  play.addEventListener("click", () => setPlaying(!playing));
  slider.addEventListener("input", () => clock.set(Number(slider.value)));
  clock.onChange((t) => {
    slider.value = t;
    find("time").textContent = `${t.toFixed(2)} s / ${end.toFixed(2)} s`;
    const current = data.events.filter(
      (e) => t >= e.time - 1e-9 && t <= e.time + Math.max(e.duration, 0.6),
    );
    find("now").textContent = current.map((e) => e.label).join(" · ");
  });

  // ---- the scene --------------------------------------------------------------------------------
  const T = window.POISE_THREE;
  const canvas = find("canvas");
  let renderer;
  try {
    renderer = new T.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  } catch {
    canvas.hidden = true;
    find("sorry").hidden = false;
    find("legend").hidden = true;
    for (const part of find("views").querySelectorAll("button, input")) part.disabled = true;
    clock.set(start);
    return;
  }
  renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = T.PCFShadowMap;

  const scene = new T.Scene();
  const camera = new T.PerspectiveCamera(32, 2, 0.02, 200);
  camera.up.set(0, 0, 1);
  const controls = new T.OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.maxPolarAngle = 0.52 * Math.PI;

  // How big the robot is: from the bodies' first positions, and at least a hand's length.
  let height = 0.2;
  for (let b = 0; b < bodies; b += 1) height = Math.max(height, position[3 * b + 2] * 1.12);
  scene.background = new T.Color(SKY);
  scene.fog = new T.Fog(SKY, 6 * height + 3, 16 * height + 8);

  scene.add(new T.HemisphereLight(0xffffff, 0xc4ccd4, 2.1));
  const sun = new T.DirectionalLight(0xffffff, 2.1);
  sun.castShadow = true;
  sun.shadow.mapSize.set(1024, 1024);
  const reach = 1.5 * height;
  Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
  sun.shadow.camera.far = 8 * height;
  sun.shadow.bias = -0.0015;
  sun.shadow.normalBias = 0.01;
  scene.add(sun, sun.target);

  // The ground is a picture of one square metre, repeated: lines of their own would flicker.
  const TILE = 256;
  function groundPicture() {
    const tile = document.createElement("canvas");
    tile.width = TILE;
    tile.height = TILE;
    const pen = tile.getContext("2d");
    pen.fillStyle = "#f6f8fa";
    pen.fillRect(0, 0, TILE, TILE);
    for (let i = 0; i <= 5; i += 1) {
      const edge = i % 5 === 0;
      const wide = edge ? 3 : 2;
      pen.fillStyle = edge ? "#b3bfcb" : "#dde4eb";
      pen.fillRect((i * TILE) / 5 - wide / 2, 0, wide, TILE);
      pen.fillRect(0, (i * TILE) / 5 - wide / 2, TILE, wide);
    }
    pen.fillStyle = "#b3bfcb";
    for (const at of [0, TILE - 1.5]) {
      pen.fillRect(at, 0, 1.5, TILE);
      pen.fillRect(0, at, TILE, 1.5);
    }
    const picture = new T.CanvasTexture(tile);
    picture.wrapS = T.RepeatWrapping;
    picture.wrapT = T.RepeatWrapping;
    picture.repeat.set(GROUND, GROUND);
    picture.anisotropy = renderer.capabilities.getMaxAnisotropy();
    picture.colorSpace = "srgb";
    return picture;
  }
  const GROUND = 80;
  const ground = new T.Mesh(
    new T.PlaneGeometry(GROUND, GROUND),
    new T.MeshBasicMaterial({ map: groundPicture() }),
  );
  ground.position.z = -0.004;
  scene.add(ground);
  const floor = new T.Mesh(new T.PlaneGeometry(GROUND, GROUND), new T.ShadowMaterial({ opacity: 0.22 }));
  floor.position.z = -0.001;
  floor.receiveShadow = true;
  scene.add(floor);

  function meshGeometry(mesh) {
    const packed = new Uint16Array(bytes(mesh.vertices));
    const points = new Float32Array(packed.length);
    for (let i = 0; i < packed.length; i += 1) {
      points[i] = mesh.low[i % 3] + packed[i] * mesh.step[i % 3];
    }
    const raw = bytes(mesh.faces);
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.BufferAttribute(points, 3));
    const index = mesh.wide ? new Uint32Array(raw) : new Uint16Array(raw);
    geometry.setIndex(new T.BufferAttribute(index, 1));
    return geometry;
  }
  const meshes = data.meshes.map(meshGeometry);
  function shape(g) {
    const s = g.size;
    if (g.shape === "box") return new T.BoxGeometry(2 * s[0], 2 * s[1], 2 * s[2]);
    if (g.shape === "sphere") return new T.SphereGeometry(s[0], 28, 20);
    if (g.shape === "ellipsoid") return new T.SphereGeometry(1, 28, 20).scale(s[0], s[1], s[2]);
    if (g.shape === "mesh") return meshes[g.mesh];
    // three.js has these along y; the record has them along z.
    const along =
      g.shape === "capsule"
        ? new T.CapsuleGeometry(s[0], 2 * s[1], 8, 24)
        : new T.CylinderGeometry(s[0], s[0], 2 * s[1], 32);
    return along.rotateX(Math.PI / 2);
  }

  const groups = [];
  for (let b = 0; b < bodies; b += 1) {
    groups.push(new T.Group());
    scene.add(groups[b]);
  }
  const materials = new Map();
  function material(rgba, flat) {
    const key = `${rgba} ${flat}`;
    if (!materials.has(key)) {
      const made = new T.MeshStandardMaterial({ roughness: 0.62, metalness: 0.05, flatShading: flat });
      made.color.setRGB(rgba[0], rgba[1], rgba[2], "srgb");
      made.opacity = rgba[3];
      made.transparent = rgba[3] < 1;
      materials.set(key, made);
    }
    return materials.get(key);
  }
  for (const g of data.geometries) {
    const mesh = new T.Mesh(shape(g), material(g.rgba, g.shape === "mesh"));
    mesh.position.fromArray(g.position);
    mesh.quaternion.fromArray(g.quaternion);
    mesh.castShadow = g.rgba[3] > 0.5;
    mesh.receiveShadow = true;
    groups[g.body].add(mesh);
  }

  // ---- markers ------------------------------------------------------------------------------------
  const overlay = new T.Group();
  scene.add(overlay);
  function ball(color, radius) {
    // Drawn through the robot: the COM lies inside it.
    const look = new T.MeshBasicMaterial({ color, transparent: true, opacity: 0.9, depthTest: false });
    const made = new T.Mesh(new T.SphereGeometry(radius, 20, 14), look);
    made.renderOrder = 5;
    overlay.add(made);
    return made;
  }
  function ring(color, radius) {
    const look = new T.MeshBasicMaterial({ color, side: T.DoubleSide, depthTest: false, transparent: true });
    const made = new T.Mesh(new T.RingGeometry(0.45 * radius, radius, 32), look);
    made.renderOrder = 4;
    overlay.add(made);
    return made;
  }
  const unit = 0.014 * height;
  const comBall = ball(COM, 1.5 * unit);
  const comFloor = ring(COM, 1.2 * unit);
  const zmpFloor = ring(ZMP, 1.6 * unit);
  const targets = markers.map(() => ball(TARGET, 1.3 * unit));

  function arrow(color) {
    const look = new T.MeshBasicMaterial({ color, transparent: true, opacity: 0.85, depthTest: false });
    const group = new T.Group();
    const shaft = new T.Mesh(new T.CylinderGeometry(1, 1, 1, 12).rotateX(Math.PI / 2), look);
    const head = new T.Mesh(new T.ConeGeometry(1, 1, 16).rotateX(Math.PI / 2), look);
    shaft.renderOrder = 6;
    head.renderOrder = 6;
    group.add(shaft, head);
    scene.add(group);
    return { group, shaft, head };
  }
  const arrows = forces.map((f) => arrow(f.kind === "push" ? PUSH : SUPPORT));
  // Ground forces and pushes differ tenfold: each kind has a scale of its own.
  const strongest = { contact: 0, push: 0 };
  for (const f of forces) {
    for (let i = 0; i < f.force.length; i += 3) {
      const size = Math.hypot(f.force[i], f.force[i + 1], f.force[i + 2]);
      if (size > strongest[f.kind]) strongest[f.kind] = size;
    }
  }
  const longest = { contact: 0.55 * height, push: 0.4 * height };

  const support = new T.Group();
  scene.add(support);
  const polygons = data.phases.map((phase) => {
    const n = phase.vertices.length;
    const corners = new Float32Array(3 * n);
    phase.vertices.forEach((v, i) => corners.set([v[0], v[1], 0.002], 3 * i));
    const outline = new T.BufferGeometry();
    outline.setAttribute("position", new T.BufferAttribute(corners, 3));
    const fill = outline.clone();
    const fan = [];
    for (let i = 1; i + 1 < n; i += 1) fan.push(0, i, i + 1);
    fill.setIndex(fan);
    const look = { color: SUPPORT, transparent: true, side: T.DoubleSide };
    const group = new T.Group();
    group.add(new T.LineLoop(outline, new T.LineBasicMaterial({ color: SUPPORT })));
    group.add(new T.Mesh(fill, new T.MeshBasicMaterial({ ...look, opacity: 0.22, depthWrite: false })));
    group.visible = false;
    support.add(group);
    return group;
  });

  // ---- one moment ------------------------------------------------------------------------------
  const a = new T.Quaternion();
  const b = new T.Quaternion();
  const up = new T.Vector3(0, 0, 1);
  const direction = new T.Vector3();
  const followed = new T.Vector3();
  let shown = { com: true, support: true, forces: true };
  let follow = true;

  function frameAt(t) {
    let low = 0;
    let high = last;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (time[middle] <= t) low = middle;
      else high = middle - 1;
    }
    const next = Math.min(low + 1, last);
    const span = time[next] - time[low];
    const share = span > 0 ? Math.min(Math.max((t - time[low]) / span, 0), 1) : 0;
    return { low, next, share };
  }
  function between(values, width, { low, next, share }, out) {
    for (let i = 0; i < width; i += 1) {
      const here = values[low * width + i];
      const there = values[next * width + i];
      out[i] = share > 0 && Number.isFinite(there) ? here + share * (there - here) : here;
    }
    return out.slice(0, width).every(Number.isFinite);
  }
  function place(object, values, width, at, z) {
    const p = [0, 0, 0];
    object.visible = between(values, width, at, p);
    object.position.set(p[0], p[1], z === undefined ? p[2] : z);
    return object.visible;
  }
  function setArrow(which, f, at) {
    const p = [0, 0, 0];
    const v = [0, 0, 0];
    const known = between(f.point, 3, at, p) && between(f.force, 3, at, v);
    const scale = strongest[f.kind] > 0 ? longest[f.kind] / strongest[f.kind] : 0;
    const length = scale * Math.hypot(v[0], v[1], v[2]);
    const { group, shaft, head } = which;
    group.visible = shown.forces && known && length > 0.01 * height;
    if (!group.visible) return;
    direction.fromArray(v).normalize();
    group.quaternion.setFromUnitVectors(up, direction);
    group.position.fromArray(p);
    // A contact's arrow starts at the contact; a push's ends where it pushes.
    if (f.kind === "push") group.position.addScaledVector(direction, -length);
    const tip = Math.min(5 * unit, 0.5 * length);
    shaft.scale.set(0.5 * unit, 0.5 * unit, length - tip);
    shaft.position.z = (length - tip) / 2;
    head.scale.set(1.5 * unit, 1.5 * unit, tip);
    head.position.z = length - tip / 2;
  }

  let pending = false;
  function draw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => {
      pending = false;
      renderer.render(scene, camera);
    });
  }
  function show(t) {
    const at = frameAt(t);
    const p = [0, 0, 0];
    for (let k = 0; k < bodies; k += 1) {
      const i = at.low * bodies + k;
      const j = at.next * bodies + k;
      for (let c = 0; c < 3; c += 1) {
        p[c] = position[3 * i + c] + at.share * (position[3 * j + c] - position[3 * i + c]);
      }
      groups[k].position.fromArray(p);
      a.fromArray(quaternion, 4 * i).normalize();
      b.fromArray(quaternion, 4 * j).normalize();
      groups[k].quaternion.slerpQuaternions(a, b, at.share);
    }
    overlay.visible = shown.com;
    if (place(comBall, com, 3, at)) {
      comFloor.visible = true;
      comFloor.position.set(comBall.position.x, comBall.position.y, 0.004);
      followed.set(comBall.position.x, comBall.position.y, 0);
    } else comFloor.visible = false;
    place(zmpFloor, zmp, 2, at, 0.005);
    targets.forEach((target, i) => place(target, markers[i].position, 3, at));
    forces.forEach((f, i) => setArrow(arrows[i], f, at));
    support.visible = shown.support;
    data.phases.forEach((phase, i) => {
      const still = i === polygons.length - 1 && t >= phase.end;
      polygons[i].visible = phase.vertices.length > 1 && t >= phase.start && (t < phase.end || still);
    });
    if (follow) moveTo(followed.x, followed.y);
    // Whole metres, so that the lines of the ground stay where they are.
    for (const plane of [ground, floor]) {
      plane.position.x = Math.round(followed.x);
      plane.position.y = Math.round(followed.y);
    }
    sun.position.set(followed.x + 1.2 * height, followed.y - 1.0 * height, 3 * height);
    sun.target.position.set(followed.x, followed.y, 0.4 * height);
    draw();
  }
  function moveTo(x, y) {
    const dx = x - controls.target.x;
    const dy = y - controls.target.y;
    controls.target.x += dx;
    controls.target.y += dy;
    camera.position.x += dx;
    camera.position.y += dy;
    controls.update();
  }
  const VIEWS = { corner: [1.0, -0.85, 0.42], front: [1, 0, 0.12], side: [0, -1, 0.12], top: [-0.01, 0, 1] };
  function look(name) {
    const distance = 2.2 * height;
    controls.target.set(followed.x, followed.y, 0.47 * height);
    direction.fromArray(VIEWS[name]).normalize();
    camera.position.copy(controls.target).addScaledVector(direction, distance);
    controls.update();
    draw();
  }

  // ---- wiring --------------------------------------------------------------------------------------
  controls.addEventListener("change", draw);
  clock.onChange(show);
  for (const button of find("views").querySelectorAll("button")) {
    button.addEventListener("click", () => look(button.value));
  }
  for (const box of find("views").querySelectorAll("input")) {
    box.addEventListener("change", () => {
      if (box.value === "follow") follow = box.checked;
      else shown = { ...shown, [box.value]: box.checked };
      show(clock.time);
    });
  }
  function legend(color, text) {
    const item = document.createElement("li");
    const dot = document.createElement("i");
    dot.style.background = `#${color.toString(16).padStart(6, "0")}`;
    item.append(dot, text);
    find("legend").append(item);
  }
  legend(COM, "COM and its shadow");
  legend(ZMP, "ZMP");
  const newtons = (n) => (n < 10 ? n.toFixed(1) : String(Math.round(n)));
  if (data.phases.length) legend(SUPPORT, "support polygon");
  if (strongest.contact > 0) legend(SUPPORT, `ground forces, longest ${newtons(strongest.contact)} N`);
  if (strongest.push > 0) legend(PUSH, `pushes, longest ${newtons(strongest.push)} N`);
  if (markers.length) legend(TARGET, "targets");

  function resize() {
    const { clientWidth: width, clientHeight: tall } = canvas.parentElement;
    if (!width || !tall) return;
    renderer.setSize(width, tall, false);
    camera.aspect = width / tall;
    camera.updateProjectionMatrix();
    draw();
  }
  new ResizeObserver(resize).observe(canvas.parentElement);
  resize();
  clock.set(start);
  look("corner");
})();
