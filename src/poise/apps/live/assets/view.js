"use strict";
// The picture: the robot, what balances it, and the handles of feet and hands.
const ABOVE = 0.06; // A handle is drawn this far above its sole [m], in the middle of the foot.
const POLE = 0.3; // Height of the poles at the ZMP and its reference [m]: a foot does not hide them.
const LINE_Z = 0.004; // Lines are drawn this far above the ground [m].
const COLOURS = { zmp: 0xd63384, com: 0x0d6efd, target: 0xfd7e14, support: 0x28a745 };
const AXES = [0xdc3545, 0x28a745, 0x0d6efd], AXIS = 0.12; // Of a hand that is turned [m].
const PALE = 0.45;
const REACH = 0.25, NEAR = 30; // A pointer is at a handle so near [m], and no less than so many pixels.
const LEASH = 0.25, TURN = 0.35; // The robot may go so far [m] and turn so far [rad] before the view goes along.
let view = null; // There is none until the shapes have come, or where the browser has no WebGL.

async function openView() {
  const shapes = await (await fetch("shapes.json")).json();
  // A picture drawn in software is coarse, so that the hands of the operator stay quick.
  const software = isSoftware();
  const stage = window.poiseScene(document.getElementById("view"), shapes, 1, {
    fov: 45,
    shadows: false,
    ratio: software ? 0.5 : Math.min(devicePixelRatio, 2),
    renderer: { antialias: !software },
  });
  // From behind: left is left, and the arrow that points away is forward. As far as it takes to see
  // all of a robot whose CoM is so high [m].
  function lookAt(height) {
    stage.camera.position.set(-2.3, 1.1, 1.3).multiplyScalar(height / 0.7);
    stage.controls.target.set(0, 0, (0.65 / 0.7) * height);
    stage.controls.update();
  }
  lookAt(0.7);
  const all = makeHandles(stage, 4);
  const handles = all.slice(0, 2), grips = all.slice(2);
  const marks = makeMarks(stage);
  const axes = grips.map(() => makeAxes(stage));
  let heading = 0;
  // What a hand's handle is dragged from, and where the torso faces then.
  grips.forEach((grip) => {
    grip.addEventListener("dragging-changed", ({ value }) => {
      if (value) grip.from = { place: grip.object.position.clone(), heading };
    });
  });
  // The view goes along with a robot that walks away or turns, and stays behind it; not while a
  // handle is dragged, which would be led elsewhere by that.
  const at = { x: 0, y: 0, heading: 0 };
  function goAlong([x, y], heading) {
    if (all.some(({ dragging }) => dragging)) return;
    const { camera, controls } = stage, { target } = controls;
    const away = Math.hypot(x - at.x, y - at.y), share = Math.max(0, 1 - LEASH / away);
    const [dx, dy] = [share * (x - at.x), share * (y - at.y)];
    const off = Math.atan2(Math.sin(heading - at.heading), Math.cos(heading - at.heading));
    const turn = Math.sign(off) * Math.max(0, Math.abs(off) - TURN);
    if (!dx && !dy && !turn) return;
    at.x += dx;
    at.y += dy;
    at.heading += turn;
    target.x += dx;
    target.y += dy;
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    const [fx, fy] = [camera.position.x + dx - target.x, camera.position.y + dy - target.y];
    camera.position.x = target.x + c * fx - s * fy;
    camera.position.y = target.y + s * fx + c * fy;
    controls.update();
  }
  view = { stage, handles, grips, show, drags, hands, allow, release };

  // A handle is drawn where the pointer is at its foot or hand, and where that is held.
  let allowed = [false, false, false, false], near = -1;
  const canvas = stage.controls.domElement;
  // Distance of the pointer to a handle, over the length of its arrows.
  function distance({ object: { position } }, x, y) {
    const box = canvas.getBoundingClientRect();
    const [from, to] = [0, REACH].map((up) => {
      const p = position.clone().setZ(position.z + up).project(stage.camera);
      return [box.left + 0.5 * box.width * (1 + p.x), box.top + 0.5 * box.height * (1 - p.y)];
    });
    return Math.hypot(x - from[0], y - from[1]) / Math.max(Math.hypot(to[0] - from[0], to[1] - from[1]), NEAR);
  }
  function point({ clientX, clientY }) {
    if (all.some(({ dragging }) => dragging)) return;
    // Whoever is on an arrow stays with it, also where another foot is nearer.
    if (near >= 0 && all[near].axis) return;
    const away = all.map((handle, i) => (allowed[i] ? distance(handle, clientX, clientY) : Infinity));
    const least = Math.min(...away);
    near = least < 1 ? away.indexOf(least) : -1;
    refresh();
  }
  // Before the handles see them, and after: an arrow that the pointer left holds it no longer.
  for (const before of [true, false])
    for (const kind of ["pointermove", "pointerdown"]) canvas.addEventListener(kind, point, before);
  function refresh() {
    const dragged = all.findIndex(({ dragging }) => dragging);
    all.forEach((handle, i) => {
      const shown = allowed[i] && (dragged < 0 ? i === near || holding()[i] : i === dragged);
      if (handle.enabled === shown && handle.getHelper().visible === shown) return;
      handle.enabled = handle.getHelper().visible = shown;
      if (!shown) handle.axis = null;
      stage.draw();
    });
  }

  let looked = false;
  function show(s) {
    if (!looked && s.com[2] > 0.75) lookAt(s.com[2]);
    looked = true;
    stage.groups.forEach((group, i) => {
      group.position.fromArray(s.bodies, 3 * i);
      const [w, x, y, z] = s.turns.slice(4 * i, 4 * i + 4);
      group.quaternion.set(x, y, z, w);
    });
    marks(s);
    handles.forEach((handle, foot) => {
      const [x, y, z] = s.handles[foot];
      if (!handle.dragging) handle.object.position.set(x, y, z + ABOVE);
    });
    heading = s.heading;
    grips.forEach((grip, hand) => {
      if (s.hands[hand] && !grip.dragging) grip.object.position.fromArray(s.hands[hand]);
      axes[hand](s.hands[hand], s.handTurns[hand]);
    });
    goAlong(s.com, s.heading);
    refresh();
    stage.follow(s.com[0], s.com[1]);
    stage.draw();
  }
  // Where the left and the right handle is held, null for one that is not.
  function drags() {
    return handles.map(({ dragging, object: { position: p } }) => (dragging ? [p.x, p.y, p.z - ABOVE] : null));
  }
  // How far each hand's handle has been dragged, as the torso faced when that began; the clutch is
  // closed meanwhile, and open for a handle that nobody holds.
  function hands() {
    return grips.map(({ dragging, from, object: { position } }) => {
      if (!dragging || !from) return { position: [0, 0, 0], clutch: false };
      const [x, y, z] = position.clone().sub(from.place).toArray();
      const [c, s] = [Math.cos(from.heading), Math.sin(from.heading)];
      return { position: [c * x + s * y, c * y - s * x, z], clutch: true };
    });
  }
  function allow(feet, hands) {
    if (!feet) handles.forEach((handle) => handle.pointerUp(null));
    if (!hands) grips.forEach((grip) => grip.pointerUp(null));
    allowed = [feet, feet, hands, hands];
    refresh();
  }
  function release() {
    for (const handle of all) handle.pointerUp(null);
  }
}

function makeHandles({ scene, camera, controls, draw }, count) {
  const T = window.POISE_THREE;
  const handles = Array.from({ length: count }, () => {
    const place = new T.Group();
    const handle = new T.TransformControls(camera, controls.domElement);
    handle.attach(place);
    handle.setSize(0.75); // Arrows of some 0.2 m, seen from the first place.
    handle.enabled = handle.getHelper().visible = false;
    handle.addEventListener("change", draw);
    scene.add(place, handle.getHelper());
    return handle;
  });
  handles.forEach((handle) => {
    // Whoever drags a handle does not turn the view.
    handle.addEventListener("dragging-changed", ({ value }) => {
      controls.enabled = !value;
    });
  });
  return handles;
}

// How a hand is led to be turned: its axes x, y, z in red, green and blue, at its place.
function makeAxes({ scene }) {
  const T = window.POISE_THREE;
  const axes = new T.Group();
  const alongY = [[0, 0, -Math.PI / 2], [0, 0, 0], [Math.PI / 2, 0, 0]];
  AXES.forEach((color, i) => {
    const rod = new T.CylinderGeometry(0.007, 0.007, AXIS, 8).translate(0, AXIS / 2, 0);
    // Seen through the hand, whose middle they begin in.
    const mesh = new T.Mesh(rod, new T.MeshBasicMaterial({ color, depthTest: false }));
    mesh.renderOrder = 1;
    mesh.rotation.set(...alongY[i]);
    axes.add(mesh);
  });
  axes.visible = false;
  axes.matrixAutoUpdate = false;
  scene.add(axes);
  return (place, turn) => {
    axes.visible = Boolean(place && turn);
    if (!axes.visible) return;
    const [a, b, c, d, e, f, g, h, i] = turn;
    axes.matrix.set(a, b, c, place[0], d, e, f, place[1], g, h, i, place[2], 0, 0, 0, 1);
    axes.matrixWorldNeedsUpdate = true;
  };
}

function makeMarks({ scene, ball, polygon }) {
  const T = window.POISE_THREE;
  function pole(radius, opacity) {
    const look = new T.MeshBasicMaterial({ color: COLOURS.zmp, transparent: opacity < 1, opacity });
    const made = new T.Mesh(new T.CylinderGeometry(radius, radius, POLE, 8).rotateX(Math.PI / 2), look);
    scene.add(made);
    return made;
  }
  const zmp = pole(0.006, 1);
  const zmpReference = pole(0.012, PALE);
  const comReference = ball(COLOURS.com, 0.04, PALE);
  const com = ball(COLOURS.com, 0.03);
  const comGround = ball(COLOURS.com, 0.015);
  const target = ball(COLOURS.target, 0.018);
  let support = null;
  let corners = "";

  return (s) => {
    // Of the feet that stand the higher one counts: marks shall not be inside the block below it.
    const standing = { SL: [s.soles[0]], SR: [s.soles[1]] }[s.mode] ?? s.soles;
    const ground = Math.max(...standing.map((sole) => sole[2])) + LINE_Z;
    zmp.position.set(...s.zmp, 0.5 * POLE);
    zmpReference.position.set(...s.zmpReference, 0.5 * POLE);
    com.position.set(...s.com);
    comGround.position.set(s.com[0], s.com[1], ground);
    comReference.position.set(...s.zmpReference, s.com[2]);
    target.visible = s.target !== null;
    if (target.visible) target.position.set(...s.target);
    const now = s.polygon.flat().map((x) => x.toFixed(3)).join();
    if (now === corners) return;
    corners = now;
    support?.removeFromParent();
    for (const piece of support?.children ?? []) piece.geometry.dispose();
    support = polygon(s.polygon, ground, COLOURS.support);
  };
}

function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}
