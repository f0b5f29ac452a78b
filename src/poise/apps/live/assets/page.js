"use strict";
const part = (id) => document.getElementById(id);
const token = new URLSearchParams(location.search).get("token");
const BEAT = 33, QUICK = 8, RETRY = 1000, SPAN = 10, HINT = 6000, COMES_BACK = 30000, SILENT = 2000;

let socket = null, driving = false;
// Which run of the robot this page has been of, and until when it may take its seat again.
let run = null, mineUntil = 0;
const keys = { left: false, right: false, upright: false, rest: false, neutral: false, arrows: new Set(), bends: new Set() };
// Keys that do what an arrow does where the robot is driven.
const ARROWS = { w: "ArrowUp", a: "ArrowLeft", s: "ArrowDown", d: "ArrowRight" };
const driven = () => newest?.kind === "velocity";
const past = [];

// The channel ---------------------------------------------------------------------------------------

function join() {
  const query = token === null ? "" : "?token=" + encodeURIComponent(token);
  socket = new WebSocket(`ws://${location.host}/control${query}`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = ({ reason }) => {
    // What was held when the connection was lost leads nothing when it is back.
    release();
    if (driving) mineUntil = performance.now() + COMES_BACK;
    driving = false;
    view?.allow(false, false);
    part("controls").disabled = true;
    part("role").textContent = "no connection";
    part("role").className = "";
    say(`${reason || "No connection to the robot. If it was moving, it has come to rest."} Trying again. ${heardAt ? `What is shown is of ${since()}.` : ""}`);
    setTimeout(join, RETRY);
  };
}

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function take(message) {
  if ("hello" in message) welcome(message);
  else if ("echo" in message) {
    latency(performance.now() - 1000 * message.echo);
    stuck = Boolean(message.again);
    if ("late" in message) hint(`What you do comes ${message.late.toFixed(1)} s late, and does not count: the connection is too slow.`);
  }
  else if ("kept" in message) kept(message.kept);
  else if ("error" in message) hint(message.error);
  else show(message);
}

function welcome(message) {
  // Another robot, or another ground below it: what is drawn here is of the one before.
  if (run !== null && run !== message.run) return location.reload();
  run = message.run;
  driving = message.hello === "operator";
  if (driving) mineUntil = 0;
  part("controls").disabled = !driving;
  part("role").textContent = driving ? "you drive" : "you watch";
  part("role").className = message.hello;
  reason = driving ? "" : message.reason || "You are watching. Only the address with the token can drive.";
  say(reason);
  if (!driving) {
    begun();
    slid = undefined;
  }
  allow();
}

// Handles are for whoever drives: of the feet where they are led, of hands where the robot has some.
let grips = false;
function allow() {
  view?.allow(driving && !driven(), driving && grips);
}

// Who came second is told when the seat gets free, and does not take it by themselves.
let reason = "";
function wait(taken) {
  if (driving || !reason.includes("Reload the page")) return;
  const now = taken ? reason : "Nobody drives now. Reload the page to drive.";
  if (notice !== now) say(now);
}

// What the connection has to say comes before what the robot has.
let notice = "";
function say(text) {
  notice = text;
  warn("");
}

function warn(text) {
  put("banner", notice || text);
  part("banner").hidden = (notice || text) === "";
}

// What is said in passing goes again by itself.
let hinted = 0;
function hint(text) {
  put("said", text);
  clearTimeout(hinted);
  hinted = setTimeout(() => put("said", "\u00a0"), HINT);
}

function kept(name) {
  clearTimeout(hinted);
  const link = document.createElement("a");
  link.href = `/takes/${name}?token=${encodeURIComponent(token)}`;
  link.download = link.textContent = name;
  part("said").replaceChildren("kept as ", link);
}

function help(shown) {
  part("help").hidden = !shown;
  part("help-open").setAttribute("aria-expanded", String(shown));
}

// The first screen shows how to begin, until that is done.
let learnt = false;
function begun() {
  learnt = true;
  part("hint").hidden = true;
}

// What is shown -------------------------------------------------------------------------------------

let smoothed = null, stuck = false; // Something is held that counts only when it is pressed anew.
function latency(now) {
  smoothed = smoothed === null ? now : 0.9 * smoothed + 0.1 * now;
  put("latency", `${smoothed.toFixed(0)} ms`, smoothed > 200);
}

// What is shown is the past, and looks like it, while nothing new comes.
let heardAt = 0, stale = false;
const since = () => new Date(heardAt).toLocaleTimeString();
function age() {
  stale = socket?.readyState !== WebSocket.OPEN || Date.now() - heardAt > SILENT;
  if (document.body.dataset.stale !== String(stale)) document.body.dataset.stale = stale;
}

// Messages are taken in as they come, and drawn no faster than the browser can.
let newest = null, drawnAt = 0, stepping = false, landings;
function show(s) {
  newest = s;
  heardAt = Date.now();
  // A connection that broke may have left the seat to a ghost of this page, which is silent.
  if (!driving && !s.driven && performance.now() < mineUntil) socket.close();
  else if (!stale) wait(s.driven);
  if (!("time" in s)) return;
  view?.show(s);
  // Not while they drag the next foot, which would move with the picture.
  if (stepping && s.mode === "D" && !view?.drags().some(Boolean)) begun();
  if (document.body.dataset.kind !== s.kind || grips !== s.hands.length > 0) {
    document.body.dataset.kind = s.kind;
    document.body.dataset.linked = s.linked;
    grips = s.hands.length > 0;
    document.body.dataset.grips = grips;
    // What no limits are known of cannot be bent.
    document.body.dataset.bends = s.limits.height[0] < 0 && s.source !== "recording";
    document.body.dataset.torso = s.limits.torso[2] > 0;
    part("hint").hidden = learnt || !driving || s.source !== "browser";
    allow();
  }
  stepping ||= s.mode === "SL" || s.mode === "SR";
  if (landings !== undefined && s.landings > landings) rumble();
  landings = s.landings;
  const last = past.at(-1);
  if (last && s.time < last.time) past.length = 0;
  const { time, zmp, zmpReference, com } = s;
  if (!last || time !== last.time) past.push({ time, zmp, zmpReference, com });
  while (s.time - past[0].time > SPAN) past.shift();
}

function paint(now) {
  requestAnimationFrame(paint);
  if (newest === null || now - drawnAt < 80) return;
  drawnAt = now;
  age();
  words(newest);
  if (past.length === 0) return;
  plot(part("plot-y"), 1);
  plot(part("plot-x"), 0);
}

function put(id, text, bad = false) {
  const place = part(id);
  if (place.textContent !== text) place.textContent = text;
  if (place.classList.contains("bad") !== bad) place.classList.toggle("bad", bad);
}

function words(s) {
  put("robot", s.robot);
  if (!("mode" in s)) return;
  for (const chip of part("modes").children) chip.classList.toggle("now", chip.dataset.mode === s.mode);
  const old = `Nothing has come from the robot since ${since()}.`;
  put("mode-text", stale ? old : s.stopped ? "damped" : s.fallen ? "fallen: press Reset" : s.modeText, stale || s.fallen);
  const lost = driving && (stuck || s.device === "OVERRULED") ? AGAIN : "";
  warn(stale ? old : s.stopped ? `The robot is damped (${s.stopped}).` : s.fallen ? `The robot has fallen. ${driving ? "Press Reset" : "Its operator has to press Reset"}.` : lost);
  put("margin", `${(100 * s.margin).toFixed(1)} cm`);
  part("margin-bar").value = Math.max(0, s.margin);
  const device = s.deviceText;
  const fed = s.source === "browser" ? (s.driven ? device : "nobody drives") : `${s.source}: ${device}`;
  put("device", fed, !["OK", "STALE"].includes(s.device));
  const slow = s.realTimeFactor < 0.95, speed = s.speed < 1 ? ` of ${s.speed} x` : "";
  put("factor", `${s.realTimeFactor.toFixed(2)}${speed}${slow ? ", slow" : ""}`, slow);
  const hands = ["left", "right"].map((side, i) => [side, HANDS[s.handsDo[i]]]).filter(([, does]) => does);
  put("hands", hands.map(([side, does]) => `${side} ${does}`).join(", ") || "at rest", s.handsDo.includes("REACH"));
  put("gaze", s.gaze === null ? "–" : GAZE[s.gaze], s.gaze === "REACH");
  put("time", `${s.time.toFixed(1)} s`);
  put("take", s.take);
  bends(s);
  part("pause").classList.toggle("on", s.paused);
  part("slow").classList.toggle("on", s.speed < 1);
}

// What a hand does that is not at rest.
const HANDS = { HELD: "held", LED: "led", REACH: "at the edge of its reach", TURNED: "turned as far as it goes" };
const GAZE = { REST: "ahead", HELD: "held", LED: "led", REACH: "as far as it goes" };
const LINES = [["zmpReference", "#6f757b", 2], ["com", "#0d6efd", 1.5], ["zmp", "#d63384", 1]];
function plot(canvas, axis) {
  const ratio = devicePixelRatio, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d"), now = past.at(-1).time;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  let low = Infinity, high = -Infinity;
  for (const s of past) for (const [name] of LINES) {
    low = Math.min(low, s[name][axis]);
    high = Math.max(high, s[name][axis]);
  }
  // Never so close that noise fills the plot.
  const middle = (low + high) / 2, half = Math.max(0.05, 0.55 * (high - low));
  const x = (t) => width * (1 - (now - t) / SPAN);
  const y = (v) => height * (0.5 - 0.5 * (v - middle) / half);
  for (const [name, colour, line] of LINES) {
    pen.beginPath();
    for (const s of past) pen.lineTo(x(s.time), y(s[name][axis]));
    pen.strokeStyle = colour;
    pen.lineWidth = line;
    pen.stroke();
  }
  pen.fillStyle = "#666";
  pen.font = "10px system-ui, sans-serif";
  pen.fillText((middle + half).toFixed(2), 3, 10);
  pen.fillText((middle - half).toFixed(2), 3, height - 3);
}

// What the operator does ----------------------------------------------------------------------------

let strange = false; // There is a gamepad of no known layout.
function gamepad() {
  // The same layout as the one of a gamepad at the robot's machine.
  const pads = [...(navigator.getGamepads?.() ?? [])].filter((p) => p && p.connected);
  const pad = pads.find((p) => p.mapping === "standard");
  if (!pad) {
    // As a browser that does not know it numbers its parts, a trigger may be taken for a stick.
    if (pads.length && !strange) hint("This browser does not know where that gamepad has its sticks: try another browser, or plug it into the robot's machine.");
    strange = pads.length > 0;
    return null;
  }
  const stick = (v) => (Math.abs(v) > 0.15 ? v : 0);
  const pressed = (i) => Boolean(pad.buttons[i]?.pressed);
  const [x, y, turn, ahead] = [0, 1, 2, 3].map((i) => -stick(pad.axes[i] ?? 0));
  // The D-pad, with B held for the torso.
  const up = pressed(12) - pressed(13), left = pressed(14) - pressed(15);
  const bend = pressed(1) ? [0, 0, up, left, 0] : [up, 0, 0, 0, left];
  return { lift: [pressed(4), pressed(5)], move: [y, x], second: [ahead, turn], turn, upright: pressed(0), bend, neutral: pressed(3) };
}

function pad() {
  const stick = gamepad(), on = (name) => (keys.arrows.has(name) ? 1 : 0);
  const move = [on("ArrowUp") - on("ArrowDown"), on("ArrowLeft") - on("ArrowRight")];
  const clip = (v) => Math.max(-1, Math.min(1, v));
  return {
    lift: [keys.left || Boolean(stick?.lift[0]), keys.right || Boolean(stick?.lift[1])],
    move: [clip(move[0] + (stick?.move[0] ?? 0)), clip(move[1] + (stick?.move[1] ?? 0))],
    second: stick?.second.map(clip) ?? [0, 0],
    turn: clip((keys.left ? 1 : 0) - (keys.right ? 1 : 0) + (stick?.turn ?? 0)),
    upright: keys.upright || Boolean(stick?.upright),
    feet: (view?.drags() ?? [null, null]).map((position) => position && { position }),
    hands: hands(),
    grip: held,
    reach: reach(),
    rest: keys.rest,
    body: slid,
    bend: bendable() ? bend(stick) : undefined,
    neutral: bendable() && (keys.neutral || Boolean(stick?.neutral)),
  };
}

let said = "";
const taken = new Set(); // Keys that are down and mean something to the robot.
const AGAIN = "The robot lost touch with this page: let go and press again.";
const missed = new Set(); // Keys that were down when the page let go of everything.
// A gamepad that can shake does so when a foot lands.
function rumble() {
  const effect = { duration: 80, strongMagnitude: 0.8, weakMagnitude: 0.4 };
  for (const stick of navigator.getGamepads?.() ?? [])
    stick?.vibrationActuator?.playEffect("dual-rumble", effect);
}

function beat() {
  // A page that nobody sees drives nothing: without beats the robot puts its feet down.
  if (!driving || document.hidden) return;
  const now = pad();
  said = JSON.stringify(now);
  send({ do: "drive", time: performance.now() / 1000, ...now });
}

// What changes need not wait for the next beat: keys and buttons say so at once, and handles and
// gamepads, which do not, are looked at this often.
function look() {
  if (driving && JSON.stringify(pad()) !== said) beat();
}

// The letter on a key; of one that is set to letters that are not Latin ones, that of its place.
function letterOf({ key, code }) {
  const place = /^Key([A-Z])$/.exec(code);
  return (place && !/^[a-z]$/i.test(key) ? place[1] : key).toLowerCase();
}

function press(event, down) {
  // A slider that was used last would take the repeats of a key that walks the robot for its own.
  if (event.repeat && taken.has(event.code)) event.preventDefault();
  if (event.repeat) {
    if (missed.has(event.code)) hint(AGAIN);
    return;
  }
  taken.delete(event.code);
  missed.delete(event.code);
  // A Mac says of no key that it was let go while this one was held.
  if (event.key === "Meta" && !down) release();
  // With one of these the browser does something of its own.
  if (down && (event.ctrlKey || event.metaKey || event.altKey)) return;
  if (event.key === "Escape" && down && newest?.linked) send({ do: "stop" });
  if (event.key === "?" && down) help(part("help").hidden);
  const letter = letterOf(event), arrow = event.key.startsWith("Arrow") ? event.key : driven() && ARROWS[letter];
  if (letter === "q") hold("left", down);
  else if (letter === "e") hold("right", down);
  else if (event.key.startsWith("Arrow")) point(arrow, down);
  else if (arrow) keys.arrows[down ? "add" : "delete"](arrow);
  else if (letter in GRIPS) grip(GRIPS[letter], down);
  else if (letter in LIFTS) raise(letter, down);
  else if (letter in BENDS && !down) keys.bends.delete(letter);
  else if (letter in BENDS && bendable()) tell(letter);
  else if (letter === "n" && (!down || bendable())) keys.neutral = down;
  else return;
  if (down) taken.add(event.code);
  event.preventDefault();
  look();
}

function hold(side, down) {
  keys[side] = down;
  part(`lift-${side}`).classList.toggle("on", down);
}

function release() {
  for (const code of taken) missed.add(code);
  taken.clear();
  hold("left", false);
  hold("right", false);
  keys.rest = keys.neutral = false;
  keys.arrows.clear();
  keys.bends.clear();
  grip(0, false);
  grip(1, false);
  view?.release();
}

// Buttons that are held, by mouse or finger, or by the keys that press one that has the focus.
function holds(button, act) {
  const held = (down) => { act(down); look(); };
  let byKey = false;
  const keyed = (down) => { if (byKey !== down) held(byKey = down); };
  for (const [kind, down] of [["keydown", true], ["keyup", false]])
    button.addEventListener(kind, (event) => { if (event.key === " " || event.key === "Enter") keyed(down); });
  button.addEventListener("blur", () => keyed(false));
  button.addEventListener("pointerdown", (event) => { button.setPointerCapture(event.pointerId); held(true); });
  for (const end of ["pointerup", "pointercancel"]) button.addEventListener(end, () => held(false));
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}

for (const side of ["left", "right"]) holds(part(`lift-${side}`), (down) => hold(side, down));
for (const button of document.querySelectorAll("[data-arrow]")) {
  const { arrow, side } = button.dataset;
  holds(button, (down) => {
    if (side) hold(side, down);
    else point(arrow, down);
  });
}
["hand-left", "hand-right"].forEach((name, hand) => holds(part(name), (down) => grip(hand, down)));
holds(part("rest"), (down) => { keys.rest = down; });
for (const button of document.querySelectorAll("[data-push]"))
  button.addEventListener("click", () => send({ do: "push", value: button.dataset.push }));
const toggled = (id) => !part(id).classList.contains("on");
part("pause").addEventListener("click", () => send({ do: "pause", value: toggled("pause") }));
part("stop").addEventListener("click", () => send({ do: "stop" }));
part("slow").addEventListener("click", () => send({ do: "slow", value: toggled("slow") }));
part("upright").addEventListener("click", () => { keys.upright = toggled("upright"); part("upright").classList.toggle("on", keys.upright); look(); });
part("reset").addEventListener("click", () => { slid = undefined; send({ do: "reset" }); });
for (const name in BENT) {
  const slider = part(`bend-${name}`);
  slider.addEventListener("input", () => { slide(name, (MIRRORED.has(name) ? -1 : 1) * slider.valueAsNumber); look(); });
}
part("neutral").addEventListener("click", () => { for (keys.neutral of [true, false]) look(); });
part("keep").addEventListener("click", () => send({ do: "keep" }));
part("help-close").addEventListener("click", () => help(false));
part("help-open").addEventListener("click", () => help(part("help").hidden));
part("hint-close").addEventListener("click", begun);
window.addEventListener("keydown", (event) => press(event, true));
window.addEventListener("keyup", (event) => press(event, false));
window.addEventListener("blur", release);
document.addEventListener("visibilitychange", release);
const beating = setInterval(beat, BEAT);
const looking = setInterval(look, QUICK);
requestAnimationFrame(paint);
openView().catch((error) => put("no-view", `The robot cannot be drawn here (${error.message}).`)).finally(join);
