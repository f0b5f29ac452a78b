"use strict";
// What is asked of body and hands: by keys, sliders and a gamepad.

// Keys that bend the body while they are held, and where to: "turn" is of the foot that is held.
const BENDS = { r: ["height", 1], f: ["height", -1], i: ["pitch", 1], k: ["pitch", -1],
  j: ["yaw", 1], l: ["yaw", -1], g: ["roll", -1], h: ["roll", 1], u: ["turn", 1], o: ["turn", -1] };
// How fast [m/s, rad/s]; a gamepad at the robot's machine is as fast.
const RATES = { height: 0.06, roll: 0.4, pitch: 0.4, yaw: 0.4, turn: 0.4 }, LONGEST = 0.1;

// Height of the COM [m], the torso's angles, and how each foot is turned [rad]: they stay as
// they are until they are changed.
const body = { height: 0, roll: 0, pitch: 0, yaw: 0, left: 0, right: 0 };
const bendable = () => driving && newest?.source === "browser" && newest.limits.height[0] < 0;
const wrapped = (angle) => angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));

// What is asked of the body; nothing where all is neutral.
function asked() {
  const fine = (v) => Math.round(1000 * v) / 1000 || 0;
  const torso = [body.roll, body.pitch, body.yaw].map(fine), turns = [body.left, body.right].map((v) => fine(wrapped(v)));
  const height = fine(body.height);
  return [height, ...torso, ...turns].some(Boolean) ? { height, torso, turns } : undefined;
}

// How far one of them goes, each foot against the other one.
function range(name) {
  const { height, torso: [roll, pitch, yaw], turns: [inwards, outwards] } = newest.limits;
  if (name === "left") return [body.right - inwards, body.right + outwards];
  if (name === "right") return [body.left - outwards, body.left + inwards];
  return { height, roll: [-roll, roll], pitch: [-pitch, pitch], yaw: [-yaw, yaw] }[name];
}

function set(name, value) {
  const [least, most] = range(name);
  body[name] = Math.max(least, Math.min(most, value));
}

function straighten() {
  for (const name in body) body[name] = 0;
}

// Bends the body, and moves hands, by as much as keys and the gamepad ask for since the last time.
let bentAt = 0;
function bend() {
  const now = performance.now(), seconds = Math.min((now - bentAt) / 1000, LONGEST);
  bentAt = now;
  reach(seconds);
  if (!bendable()) return;
  const stick = gamepad(), way = { height: 0, roll: 0, pitch: 0, yaw: 0, turn: 0, ...stick?.bend };
  if (stick?.neutral) straighten();
  for (const key of keys.bends) way[BENDS[key][0]] += BENDS[key][1];
  const step = (name) => seconds * RATES[name] * Math.max(-1, Math.min(1, way[name]));
  for (const name of ["height", "roll", "pitch", "yaw"]) if (way[name]) set(name, body[name] + step(name));
  if (!way.turn) return;
  const drags = view?.drags() ?? [null, null];
  ["left", "right"].forEach((side, i) => {
    if (keys[side] || stick?.lift[i] || drags[i]) set(side, body[side] + step("turn"));
  });
}

const degrees = (v, more, less) => {
  const whole = Math.round((180 / Math.PI) * wrapped(v));
  return whole ? `${Math.abs(whole)}° ${whole > 0 ? more : less}` : "0°";
};
const BENT = {
  height: (v) => { const cm = (100 * v).toFixed(0); return `${cm > 0 ? "+" : ""}${Number(cm)} cm`.replace("-", "−"); },
  roll: (v) => degrees(v, "right", "left"),
  pitch: (v) => degrees(v, "forward", "back"),
  yaw: (v) => degrees(v, "left", "right"),
  left: (v) => degrees(v, "left", "right"),
  right: (v) => degrees(v, "left", "right"),
};
const BENT_PART = { height: "", roll: "tilt ", pitch: "lean ", yaw: "turn ", left: "left foot ", right: "right foot " };
// Sliders whose right is the robot's right, where more is to the left.
const MIRRORED = new Set(["yaw", "left", "right"]);

// Sliders and words say what is asked of the body, here or by whoever else leads it.
function bends({ asked: far }) {
  part("bends").disabled = !bendable();
  if (!bendable()) {
    [body.height, body.roll, body.pitch, body.yaw] = [far.height, ...far.torso];
    [body.left, body.right] = far.turns;
  }
  const told = [];
  for (const name in body) {
    const slider = part(`bend-${name}`), sign = MIRRORED.has(name) ? -1 : 1;
    [slider.min, slider.max] = range(name).map((v) => sign * v).sort((a, b) => a - b);
    slider.value = sign * body[name];
    const text = BENT[name](body[name]);
    put(`bent-${name}`, text);
    if (!text.startsWith("0")) told.push(BENT_PART[name] + text);
  }
  put("body-now", told.join(", "));
}

// A key that bends the body is pressed: the body says so, or the page why it does not.
function tell(letter) {
  keys.bends.add(letter);
  const [what] = BENDS[letter];
  if (what !== "height" && newest.limits.torso[2] === 0) hint("Where velocities are commanded, only the height of the body changes.");
  else if (what === "turn" && !pad().lift.some(Boolean) && !pad().feet.some(Boolean)) hint("A foot is turned while it is held: hold Q or E as well.");
}

// Keys that hold a hand, left and right; then arrows and two letters move it along the torso's axes.
const GRIPS = { c: 0, v: 1 }, LIFTS = { t: "Up", b: "Down" };
const WAYS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], Up: [2, 1], Down: [2, -1] };
const HAND_SPEED = 0.15; // [m/s]
const held = [false, false], ways = new Set(), moved = [[0, 0, 0], [0, 0, 0]];

function grip(hand, down) {
  // Where a hand is dragged, that leads it.
  if (down && (!driving || !grips || view?.hands()[hand].clutch)) return;
  if (down && !held[hand]) moved[hand] = [0, 0, 0];
  // A handle that is taken hold of meanwhile would lead from elsewhere.
  if (held[hand]) view?.grips[hand].pointerUp(null);
  held[hand] = down;
  if (!held.some(Boolean)) ways.clear();
  part(["hand-left", "hand-right"][hand]).classList.toggle("on", down);
}

function reach(seconds) {
  for (const way of ways) {
    const [axis, sign] = WAYS[way];
    held.forEach((on, hand) => {
      if (on) moved[hand][axis] += sign * seconds * HAND_SPEED;
    });
  }
}

// What leads the hands: keys or handles.
function hands() {
  if (!grips) return [null, null];
  const dragged = view?.hands();
  return held.map((on, hand) => on ? { position: moved[hand].map((v) => Math.round(1e4 * v) / 1e4), clutch: true }
    : dragged?.[hand] ?? { position: [0, 0, 0], clutch: false });
}

// An arrow key leads a hand that is held when it is pressed, until it is let go; else a foot, or the robot.
function point(arrow, down) {
  if (!down) {
    keys.arrows.delete(arrow);
    ways.delete(arrow);
  } else if (held.some(Boolean)) ways.add(arrow);
  else {
    keys.arrows.add(arrow);
    if (driving && !driven() && !keys.left && !keys.right) hint("Arrows walk the robot, if it takes torques. To move a foot, hold Q or E as well; a hand, C or V.");
  }
}

function raise(letter, down) {
  if (!down) ways.delete(LIFTS[letter]);
  else if (held.some(Boolean)) ways.add(LIFTS[letter]);
  else if (driving && grips) hint("A hand is moved while it is held: hold C or V as well.");
}
