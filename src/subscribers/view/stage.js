// Draws the frames that /frames sends. Motion is interpolated one arrival interval behind the newest frame.
"use strict";
const element = (id) => document.getElementById(id);
const canvas = element("stage"), context = canvas.getContext("2d");
const STATES = ["○ moving", "△ approaching", "✖ contact", "■ stall", "■ lock", "● path end"];
const SHADES = 24;
const view = { x: 0, y: 0, zoom: 1, follow: false };
let stage = null, alertNow = null, previous = null, newest = null, interval = 50, chosen = -1, retry = 250;
const picture = { frames: 0, drawn: 0, head: null, state: null, connected: false };
window.picture = picture;

function connect() {
  const socket = new WebSocket(`ws://${location.host}/frames`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { picture.connected = true; retry = 250; };
  socket.onmessage = ({ data }) => typeof data === "string" ? tell(JSON.parse(data)) : receive(data);
  socket.onclose = () => { picture.connected = false; wait("○ waiting for the server"); setTimeout(connect, retry); retry = Math.min(5000, retry * 2); };
}
function wait(text) { previous = newest = alertNow = null; picture.state = null; element("state").textContent = text; element("countdown").textContent = ""; element("alert").textContent = ""; }
function tell(message) {
  if (message.type === "stage") { stage = message; return; }
  if (message.type === "waiting") { wait("○ waiting for a publisher"); return; }
  const pair = message.bench_b !== null ? `benches ${message.bench_a + 1} and ${message.bench_b + 1}` : message.bench_a !== null ? `bench ${message.bench_a + 1}` : "";
  const text = message.level === "clear" ? "" : `${message.level}${pair ? `: ${pair} (counted from 1)` : ""}`;
  if (element("alert").textContent !== text) element("alert").textContent = text;
  alertNow = message;
}
function receive(data) {
  const bytes = new DataView(data);
  if (bytes.getUint8(0) !== 1) { wait("! this page is for another version: load it again"); return; }
  const frame = { at: performance.now(), state: bytes.getUint8(1), time: bytes.getFloat64(8, true), scale: bytes.getFloat64(16, true),
    clearance: bytes.getFloat32(32, true), handles: new Float32Array(data, 40) };
  if (newest) interval += 0.1 * (Math.min(1000, frame.at - newest.at) - interval);
  previous = newest && newest.handles.length === frame.handles.length && frame.time >= newest.time ? newest : frame;
  newest = frame; picture.frames++; picture.state = frame.state;
}
function draw() {
  requestAnimationFrame(draw);
  const ratio = devicePixelRatio, wide = Math.round(innerWidth * ratio), high = Math.round(innerHeight * ratio);
  if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
  context.setTransform(1, 0, 0, 1, 0, 0); context.clearRect(0, 0, wide, high);
  if (!stage || !newest) return;
  const part = Math.min(1, (performance.now() - newest.at) / interval), a = previous.handles, b = newest.handles;
  const at = (k) => a[k] + (b[k] - a[k]) * part;
  if (view.follow) { view.x = at(0); view.y = at(1); }
  const scale = Math.min(wide, high) / (2.3 * stage.pitch * (stage.start_turn + 1)) * view.zoom;
  context.setTransform(scale, 0, 0, -scale, wide / 2 - view.x * scale, high / 2 + view.y * scale);
  const ink = getComputedStyle(canvas).color, danger = getComputedStyle(element("countdown")).color;
  context.strokeStyle = ink; context.globalAlpha = 0.25; context.lineWidth = 1 / scale; context.beginPath();
  for (let turn = 0, end = stage.start_turn + 1; turn < end; turn += Math.max(0.02, end / 4000)) {
    context.lineTo(stage.pitch * turn * Math.cos(2 * Math.PI * turn), stage.pitch * turn * Math.sin(2 * Math.PI * turn));
  }
  context.stroke(); context.globalAlpha = 1;
  const count = b.length / 4 - 1;
  let slow = Infinity, fast = -Infinity;
  for (let i = 0; i <= count; i++) { const v = b[4 * i + 3]; if (v < slow) slow = v; if (v > fast) fast = v; }
  const paths = Array.from({ length: SHADES }, () => new Path2D()), outline = (path, i) => {
    const x = at(4 * i), y = at(4 * i + 1), u = at(4 * i + 4), w = at(4 * i + 5), link = Math.hypot(x - u, y - w) || 1;
    const c = (x - u) / link, s = (y - w) / link, e = stage.hole_inset, h = stage.width / 2, p = e * c, q = e * s;
    path.moveTo(x + p - h * s, y + q + h * c); path.lineTo(u - p - h * s, w - q + h * c);
    path.lineTo(u - p + h * s, w - q - h * c); path.lineTo(x + p + h * s, y + q - h * c); path.closePath();
  };
  for (let i = 0; i < count; i++) outline(paths[Math.min(SHADES - 1, Math.floor((b[4 * i + 3] - slow) / (fast - slow || 1) * SHADES)) || 0], i);
  paths.forEach((path, k) => { context.fillStyle = `hsl(${260 - 220 * k / SHADES} 75% 50%)`; context.fill(path); });
  const mark = (i, colour, width) => { const path = new Path2D(); outline(path, i); context.strokeStyle = colour; context.lineWidth = width / scale; context.stroke(path); };
  mark(0, ink, 3 * ratio); context.setLineDash([4 * ratio / scale, 3 * ratio / scale]); mark(count - 1, ink, 2 * ratio); context.setLineDash([]);
  if (chosen >= 0 && chosen < count) mark(chosen, ink, 4 * ratio);
  if (alertNow && alertNow.level !== "clear") {
    for (const i of [alertNow.bench_a, alertNow.bench_b]) if (i !== null && i < count) mark(i, danger, 5 * ratio);
    if (alertNow.x !== null) { context.beginPath(); context.arc(alertNow.x, alertNow.y, 14 * ratio / scale, 0, 7); context.strokeStyle = danger; context.lineWidth = 3 * ratio / scale; context.stroke(); }
  }
  picture.head = [wide / 2 + (at(0) - view.x) * scale, high / 2 - (at(1) - view.y) * scale]; picture.scale = scale / ratio; picture.drawn++;
  show(slow, fast);
}
function show(slow, fast) {
  const put = (id, text) => { if (element(id).textContent !== text) element(id).textContent = text; };
  put("state", STATES[newest.state] ?? "? unknown");
  const left = newest.state === 1 && alertNow?.event_time != null ? Math.max(0, (alertNow.event_time - newest.time) / newest.scale) : NaN;
  put("countdown", newest.state >= 2 && newest.state <= 4 ? STATES[newest.state].toUpperCase() : left >= 0 ? `${left.toFixed(1)} s` : "");
  put("time", `t = ${newest.time.toFixed(2)} s`); put("slow", slow.toFixed(2)); put("fast", fast.toFixed(2));
  element("clearance").value = newest.clearance || 0; put("metres", Number.isNaN(newest.clearance) ? "not computed" : `${newest.clearance.toFixed(3)} m`);
  const b = newest.handles, k = 4 * chosen;
  put("bench", chosen >= 0 && k < b.length ? `Bench ${chosen + 1} (counted from 1): front handle (${b[k].toFixed(2)}, ${b[k + 1].toFixed(2)}) m, ${b[k + 3].toFixed(3)} m/s` : "");
}
const fingers = new Map(); let moved = 0;
const pan = (x, y) => { view.follow = false; press(); view.x -= x / picture.scale; view.y += y / picture.scale; };
const zoom = (by) => { view.zoom = Math.min(1000, Math.max(0.2, view.zoom * by)); };
const press = () => element("follow").setAttribute("aria-pressed", view.follow);
const whole = () => { Object.assign(view, { x: 0, y: 0, zoom: 1, follow: false }); press(); };
const follow = () => { view.follow = !view.follow; if (view.follow && view.zoom < 3) view.zoom = 3; press(); };
canvas.onpointerdown = (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); moved = 0; };
canvas.onpointermove = (event) => {
  const old = fingers.get(event.pointerId); if (!old) return;
  const x = event.clientX - old.clientX, y = event.clientY - old.clientY; moved += Math.hypot(x, y);
  const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
  const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY) || 1;
  if (other) zoom(apart(event) / apart(old)); else if (picture.scale) pan(x, y);
  fingers.set(event.pointerId, event);
};
canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
canvas.onpointerup = (event) => {
  fingers.delete(event.pointerId); if (moved > 6 || !newest || !picture.scale) return;
  const x = view.x + (event.clientX - innerWidth / 2) / picture.scale, y = view.y - (event.clientY - innerHeight / 2) / picture.scale, b = newest.handles;
  let best = 1.5; chosen = -1;
  for (let i = 0; i + 1 < b.length / 4; i++) { const away = Math.hypot((b[4 * i] + b[4 * i + 4]) / 2 - x, (b[4 * i + 1] + b[4 * i + 5]) / 2 - y); if (away < best) { best = away; chosen = i; } }
};
canvas.onwheel = (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 500)); };
const keys = { "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), 0: whole, f: follow, ArrowLeft: () => pan(40, 0), ArrowRight: () => pan(-40, 0), ArrowUp: () => pan(0, 40), ArrowDown: () => pan(0, -40) };
onkeydown = (event) => { if (!event.ctrlKey && !event.metaKey && picture.scale) keys[event.key]?.(); };
element("follow").onclick = follow; element("whole").onclick = whole;
element("theme").onclick = () => { const root = document.documentElement; const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches; root.dataset.theme = dark ? "light" : "dark"; };
connect(); draw();
