"use strict";
const part = (id) => document.getElementById(id);
const token = new URLSearchParams(location.search).get("token");
const BEAT = 33, RETRY = 1000, SPAN = 10;

let socket = null, driving = false;
const keys = { left: false, right: false, upright: false, arrows: new Set() };
// Keys that do what an arrow does where the robot is driven.
const ARROWS = { w: "ArrowUp", a: "ArrowLeft", s: "ArrowDown", d: "ArrowRight" };
const driven = () => newest?.kind === "velocity";
const past = [];

// The channel ---------------------------------------------------------------------------------------

function join() {
  const query = token === null ? "" : "?token=" + encodeURIComponent(token);
  socket = new WebSocket(`ws://${location.host}/control${query}`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => {
    driving = false;
    view?.allow(false);
    part("controls").disabled = true;
    part("role").textContent = "no connection";
    part("role").className = "";
    say("No connection to the robot. If it was moving, it has put its feet down. Trying again.");
    setTimeout(join, RETRY);
  };
}

function send(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function take(message) {
  if ("hello" in message) welcome(message);
  else if ("echo" in message) latency(performance.now() - message.echo);
  else if ("kept" in message) kept(message.kept);
  else if ("error" in message) part("said").textContent = message.error;
  else show(message);
}

function welcome(message) {
  driving = message.hello === "operator";
  part("controls").disabled = !driving;
  part("role").textContent = driving ? "you drive" : "you watch";
  part("role").className = message.hello;
  say(driving ? "" : message.reason || "You are watching. Only the address with the token can drive.");
  part("help").hidden = part("help").hidden || !driving;
  view?.allow(driving && !driven());
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

function kept(name) {
  const link = document.createElement("a");
  link.href = `/takes/${name}?token=${encodeURIComponent(token)}`;
  link.download = link.textContent = name;
  part("said").replaceChildren("kept as ", link);
}

// What is shown -------------------------------------------------------------------------------------

let smoothed = null;
function latency(now) {
  smoothed = smoothed === null ? now : 0.9 * smoothed + 0.1 * now;
  put("latency", `${smoothed.toFixed(0)} ms`, smoothed > 200);
}

// Messages are taken in as they come, and drawn no faster than the browser can.
let newest = null, drawnAt = 0, stepping = false;
function show(s) {
  newest = s;
  if (!("time" in s)) return;
  view?.show(s);
  // Whoever has made a step needs no more help.
  if (driving && stepping && s.mode === "D") part("help").hidden = true;
  if (document.body.dataset.kind !== s.kind) {
    document.body.dataset.kind = s.kind;
    view?.allow(driving && !driven());
  }
  stepping = s.mode === "SL" || s.mode === "SR";
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
  put("mode-text", s.fallen ? "fallen: press Reset" : s.modeText, s.fallen);
  warn(s.fallen ? `The robot has fallen. ${driving ? "Press Reset" : "Its operator has to press Reset"}.` : "");
  put("margin", `${(100 * s.margin).toFixed(1)} cm`);
  part("margin-bar").value = Math.max(0, s.margin);
  // Between two samples the last one holds: that is no news.
  const device = s.device === "STALE" ? "ok" : s.deviceText;
  const fed = s.source === "browser" ? (s.driven ? device : "nobody drives") : `${s.source}: ${device}`;
  put("device", fed, !["OK", "STALE"].includes(s.device));
  const slow = s.realTimeFactor < 0.95, speed = s.speed < 1 ? ` of ${s.speed} x` : "";
  put("factor", `${s.realTimeFactor.toFixed(2)}${speed}${slow ? ", slow" : ""}`, slow);
  put("time", `${s.time.toFixed(1)} s`);
  put("take", s.take);
  part("pause").classList.toggle("on", s.paused);
  part("slow").classList.toggle("on", s.speed < 1);
}

const LINES = [["zmpReference", "#9aa0a6", 2], ["com", "#0d6efd", 1.5], ["zmp", "#d63384", 1]];
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

function gamepad() {
  // The same layout as the one of a gamepad at the robot's machine.
  const pad = [...(navigator.getGamepads?.() ?? [])].find((p) => p && p.connected);
  if (!pad) return null;
  const stick = (v) => (Math.abs(v) > 0.15 ? v : 0);
  const pressed = (i) => Boolean(pad.buttons[i]?.pressed);
  const [x, y, turn] = [0, 1, 2].map((i) => -stick(pad.axes[i] ?? 0));
  return { lift: [pressed(4), pressed(5)], move: [y, x], turn, upright: pressed(0) };
}

function beat() {
  // A page that nobody sees drives nothing: without beats the robot puts its feet down.
  if (!driving || document.hidden) return;
  const pad = gamepad(), on = (name) => (keys.arrows.has(name) ? 1 : 0);
  const move = [on("ArrowUp") - on("ArrowDown"), on("ArrowLeft") - on("ArrowRight")];
  const clip = (v) => Math.max(-1, Math.min(1, v));
  send({
    do: "drive",
    beat: performance.now(),
    lift: [keys.left || Boolean(pad?.lift[0]), keys.right || Boolean(pad?.lift[1])],
    move: [clip(move[0] + (pad?.move[0] ?? 0)), clip(move[1] + (pad?.move[1] ?? 0))],
    turn: clip((keys.left ? 1 : 0) - (keys.right ? 1 : 0) + (pad?.turn ?? 0)),
    upright: keys.upright || Boolean(pad?.upright),
    drag: view?.drags() ?? [null, null],
  });
}

function press(event, down) {
  if (event.repeat) return;
  const arrow = event.key.startsWith("Arrow") ? event.key : driven() && ARROWS[event.key.toLowerCase()];
  if (event.key === "q" || event.key === "Q") hold("left", down);
  else if (event.key === "e" || event.key === "E") hold("right", down);
  else if (arrow) {
    if (down) {
      keys.arrows.add(arrow);
      if (driving && !driven() && !keys.left && !keys.right) put("said", "Arrows move the foot that you hold: hold Q or E as well.");
    } else keys.arrows.delete(arrow);
  } else return;
  event.preventDefault();
  // The robot need not wait for the next beat.
  beat();
}

function hold(side, down) {
  keys[side] = down;
  part(`lift-${side}`).classList.toggle("on", down);
}

function release() {
  hold("left", false);
  hold("right", false);
  keys.arrows.clear();
  view?.release();
}

for (const side of ["left", "right"]) {
  const button = part(`lift-${side}`);
  button.addEventListener("pointerdown", (event) => { button.setPointerCapture(event.pointerId); hold(side, true); });
  for (const end of ["pointerup", "pointercancel"]) button.addEventListener(end, () => hold(side, false));
}
for (const button of document.querySelectorAll("[data-push]"))
  button.addEventListener("click", () => send({ do: "push", value: button.dataset.push }));
const toggled = (id) => !part(id).classList.contains("on");
part("pause").addEventListener("click", () => send({ do: "pause", value: toggled("pause") }));
part("slow").addEventListener("click", () => send({ do: "slow", value: toggled("slow") }));
part("upright").addEventListener("click", () => { keys.upright = toggled("upright"); part("upright").classList.toggle("on", keys.upright); });
part("reset").addEventListener("click", () => send({ do: "reset" }));
part("keep").addEventListener("click", () => send({ do: "keep" }));
part("help-close").addEventListener("click", () => { part("help").hidden = true; });
window.addEventListener("keydown", (event) => press(event, true));
window.addEventListener("keyup", (event) => press(event, false));
window.addEventListener("blur", release);
document.addEventListener("visibilitychange", release);
setInterval(beat, BEAT);
requestAnimationFrame(paint);
openView().catch((error) => put("no-view", `The robot cannot be drawn here (${error.message}).`)).finally(join);
