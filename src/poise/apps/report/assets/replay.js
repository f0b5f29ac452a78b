// The 3D replay: bodies, support polygon, CoM, ZMP and forces, drawn from the page's own data.
(() => {
  "use strict";
  const element = document.getElementById("replay");
  const data = JSON.parse(document.getElementById("replay-data").textContent);
  const find = (name) => element.querySelector(`[data-part="${name}"]`);
  const CoM = 0x0072b2;
  const ZMP = 0xd55e00;
  const SUPPORT = 0x009e73;
  const PUSH = 0xcc79a7;
  const TARGET = 0xe69f00;

  // ---- data ----------------------------------------------------------------------------------
  const { bytes } = window.poiseScene;
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
  // How big the robot is: from the bodies' first positions, and at least a hand's length.
  let height = 0.2;
  for (let b = 0; b < bodies; b += 1) height = Math.max(height, position[3 * b + 2] * 1.12);
  let view;
  try {
    view = window.poiseScene(canvas, data, height, {
      fov: 32,
      shadows: true,
      ratio: Math.min(window.devicePixelRatio, 2),
      renderer: { antialias: true, preserveDrawingBuffer: true },
    });
  } catch {
    canvas.hidden = true;
    find("sorry").hidden = false;
    find("legend").hidden = true;
    for (const part of find("views").querySelectorAll("button, input")) part.disabled = true;
    clock.set(start);
    return;
  }
  const { scene, camera, controls, groups, draw } = view;

  // ---- markers ------------------------------------------------------------------------------------
  const overlay = new T.Group();
  scene.add(overlay);
  function ball(color, radius) {
    const made = view.ball(color, radius);
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
  const comBall = ball(CoM, 1.5 * unit);
  const comFloor = ring(CoM, 1.2 * unit);
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
    const made = view.polygon(phase.vertices, 0.002, SUPPORT);
    made.visible = false;
    support.add(made);
    return made;
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
    view.follow(followed.x, followed.y);
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
  legend(CoM, "CoM and its shadow");
  legend(ZMP, "ZMP");
  const newtons = (n) => (n < 10 ? n.toFixed(1) : String(Math.round(n)));
  if (data.phases.length) legend(SUPPORT, "support polygon");
  if (strongest.contact > 0) legend(SUPPORT, `ground forces, longest ${newtons(strongest.contact)} N`);
  if (strongest.push > 0) legend(PUSH, `pushes, longest ${newtons(strongest.push)} N`);
  if (markers.length) legend(TARGET, "targets");

  clock.set(start);
  look("corner");
})();
