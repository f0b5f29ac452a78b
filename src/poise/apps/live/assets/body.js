"use strict";
// What is asked of body and hands: by keys, sliders and a gamepad. The robot's machine makes positions of it.

// Keys that bend the body while they are held, with their place in the message and their sign: the
// last one turns the foot that is held.
const BENDS = { r: [0, 1], f: [0, -1], g: [1, -1], h: [1, 1], i: [2, 1], k: [2, -1], j: [3, 1], l: [3, -1], u: [4, 1], o: [4, -1] };
const bendable = () => driving && newest?.source === "browser" && newest.limits.height[0] < 0;
const wrapped = (angle) => angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));

// Where sliders have put the body last: height of the CoM [m], the torso's angles, and how each foot is
// turned [rad]; keys go on from there.
let slid;
const flat = ({ height, torso: [roll, pitch, yaw], turns: [left, right] }) => ({ height, roll, pitch, yaw, left, right });

function slide(name, value) {
  const { height, roll, pitch, yaw, left, right } = { ...flat(newest.asked), [name]: value };
  slid = { height, torso: [roll, pitch, yaw], turns: [left, right] };
}

// How far one of them goes, each foot against the other one.
function range(name) {
  const { height, torso: [roll, pitch, yaw], turns: [inwards, outwards] } = newest.limits;
  const { left, right } = flat(newest.asked);
  if (name === "left") return [right - inwards, right + outwards];
  if (name === "right") return [left - outwards, left + inwards];
  return { height, roll: [-roll, roll], pitch: [-pitch, pitch], yaw: [-yaw, yaw] }[name];
}

// Where keys and the gamepad send the body.
function bend(stick) {
  const way = [...(stick?.bend ?? [0, 0, 0, 0, 0])];
  for (const key of keys.bends) way[BENDS[key][0]] += BENDS[key][1];
  return way.some(Boolean) ? way.map((v) => Math.max(-1, Math.min(1, v))) : undefined;
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

// Sliders and words say what is asked of the body, by whoever leads it.
function bends({ asked }) {
  part("bends").disabled = !bendable();
  const told = [], body = flat(asked);
  for (const name in body) {
    const slider = part(`bend-${name}`), sign = MIRRORED.has(name) ? -1 : 1;
    [slider.min, slider.max] = range(name).map((v) => sign * v).sort((a, b) => a - b);
    // What is dragged now is ahead of what the robot says.
    if (!slider.matches(":active")) slider.value = sign * body[name];
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
  if (what > 0 && newest.limits.torso[2] === 0) hint("Where velocities are commanded, only the height of the body changes.");
  else if (what === 4 && !pad().lift.some(Boolean) && !pad().feet.some(Boolean)) hint("A foot is turned while it is held: hold Q or E as well.");
}

// Keys that hold a hand, left and right; then arrows and two letters move it along the torso's axes.
const GRIPS = { c: 0, v: 1 }, LIFTS = { t: "Up", b: "Down" };
const WAYS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [1, 1], ArrowRight: [1, -1], Up: [2, 1], Down: [2, -1] };
const held = [false, false], ways = new Set();

function grip(hand, down) {
  // Where a hand is dragged, that leads it.
  if (down && (!driving || !grips || view?.hands()[hand].clutch)) return;
  // A handle that is taken hold of meanwhile would lead from elsewhere.
  if (held[hand]) view?.grips[hand].pointerUp(null);
  held[hand] = down;
  if (!held.some(Boolean)) ways.clear();
  part(["hand-left", "hand-right"][hand]).classList.toggle("on", down);
}

// Feet and hands that keys hold.
const holding = () => [!driven() && keys.left, !driven() && keys.right, ...held];

// Where keys send the hands that they hold.
function reach() {
  const way = [0, 0, 0];
  for (const name of ways) way[WAYS[name][0]] += WAYS[name][1];
  return way;
}

// What handles lead the hands; open where none is held.
const hands = () => (grips ? view?.hands() : null) ?? [null, null];

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
