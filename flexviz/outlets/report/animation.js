"use strict";
// Draws the measured robot on the left and the identified one on the right: exponentials of the joints'
// screw axes, faces sorted by depth and shaded by their direction.
const data = JSON.parse(document.getElementById("data").textContent);
const at = id => document.getElementById(id);
const canvas = at("scene"), pen = canvas.getContext("2d"), slider = at("time");
const last = data.time.length - 1;
const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
let now = 0, playing = !still, before = null, model = data.models.length - 1;

slider.max = last;
if (!data.models.length) at("factor").disabled = true;
at("factor").value = String(data.factor);

function motion(screw, q) {  // exp(q [w, v]) as 12 numbers, row by row
  const [x, y, z, a, b, c] = screw;
  const turns = Math.hypot(x, y, z) > 0.5;
  const s = turns ? Math.sin(q) : 0, k = turns ? 1 - Math.cos(q) : 0, m = turns ? q - Math.sin(q) : 0;
  const ww = [[-y * y - z * z, x * y, x * z], [x * y, -x * x - z * z, y * z], [x * z, y * z, -x * x - y * y]];
  const w = [[0, -z, y], [z, 0, -x], [-y, x, 0]];
  const out = [];
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) out.push((i === j ? 1 : 0) + s * w[i][j] + k * ww[i][j]);
    let t = q * [a, b, c][i];
    for (let j = 0; j < 3; j++) t += (k * w[i][j] + m * ww[i][j]) * [a, b, c][j];
    out.push(t);
  }
  return out;
}

function after(p, q) {  // the motion q, then p
  const out = [];
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 4; j++) {
      let sum = j === 3 ? p[4 * i + 3] : 0;
      for (let k = 0; k < 3; k++) sum += p[4 * i + k] * q[4 * k + j];
      out.push(sum);
    }
  }
  return out;
}

function robot(angles, colour, left, width, height) {
  const [halfWidth, halfHeight] = data.extent;
  const scale = Math.min(0.46 * width / halfWidth, 0.46 * height / halfHeight);
  const [right, up, towards] = data.view, faces = [];
  const rgb = [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16));
  for (const body of data.bodies) {
    let pose = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
    for (const joint of body.chain) pose = after(pose, motion(data.screws[joint], angles[joint]));
    const points = body.vertices.map(v => {
      const p = [0, 1, 2].map(i => pose[4 * i] * v[0] + pose[4 * i + 1] * v[1] + pose[4 * i + 2] * v[2]
        + pose[4 * i + 3] - data.centre[i]);
      return [right, up, towards].map(d => d[0] * p[0] + d[1] * p[1] + d[2] * p[2]);
    });
    const base = body.chain.length === 0;
    for (const [i, j, k] of body.faces) {
      const a = points[i], b = points[j], c = points[k];
      const u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]], v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const size = Math.hypot(...n);
      if (n[2] <= 0 || size === 0) continue;
      const light = 0.45 + 0.55 * Math.max((0.243 * n[0] + 0.535 * n[1] + 0.778 * n[2]) / size, 0);
      const shade = (base ? [176, 184, 192] : rgb).map(value => Math.round(light * value));
      faces.push([a[2] + b[2] + c[2], [a, b, c], `rgb(${shade})`]);
    }
  }
  faces.sort((one, other) => one[0] - other[0]);
  for (const [, corners, fill] of faces) {
    pen.fillStyle = pen.strokeStyle = fill;
    pen.beginPath();
    for (const [x, y] of corners) pen.lineTo(left + width / 2 + scale * x, height / 2 - scale * y);
    pen.closePath();
    pen.fill();
    pen.stroke();
  }
}

function between(rows) {  // linearly interpolated at the instant shown
  const first = Math.min(Math.floor(now), last - 1), share = now - first;
  return rows[first].map((value, joint) => (1 - share) * value + share * rows[first + 1][joint]);
}

function draw() {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineWidth = 0.5;
  const measured = between(data.measured), factor = Number(at("factor").value);
  robot(measured, data.colours.measured, 0, width / 2, height);
  let text = "";
  if (model >= 0) {
    const simulated = between(data.models[model].theta);
    const error = simulated.map((value, joint) => value - measured[joint]);
    robot(measured.map((value, joint) => value + factor * error[joint]), data.colours.model,
      width / 2, width / 2, height);
    const name = data.models.length > 1 ? ` (${data.models[model].name})` : "";
    at("identified").textContent = `identified${name}, error × ${factor}`;
    text = `Error of the motor angle [${data.unit}]: ` + error.map(
      (value, joint) => `${data.joints[joint]} ${(1000 * value).toFixed(2)}`).join(", ");
  }
  at("errors").textContent = text.replaceAll("-", "−");
  const seconds = data.start + (between(data.time.map(t => [t])))[0];
  at("clock").textContent = `${seconds.toFixed(2)} s`;
  slider.value = String(Math.round(now));
}

function frame(instant) {
  if (playing) {
    const passed = before === null ? 0 : (instant - before) / 1000 * Number(at("speed").value);
    now += passed * last / data.time[last];
    if (now >= last) now %= last;
    draw();
  }
  before = instant;
  requestAnimationFrame(frame);
}

function play(on) {
  playing = on;
  at("play").textContent = on ? "Pause" : "Play";
}

function go(place) {
  play(false);
  now = Math.max(0, Math.min(last, place));
  draw();
}

at("play").addEventListener("click", () => play(!playing));
slider.addEventListener("input", () => go(Number(slider.value)));
at("factor").addEventListener("change", draw);
for (const button of document.querySelectorAll("#models input"))
  button.addEventListener("change", () => { model = Number(button.value); draw(); });
addEventListener("resize", draw);
addEventListener("keydown", event => {
  if (["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName)) return;
  if (event.key === " ") { event.preventDefault(); play(!playing); }
  if (event.key === "ArrowLeft") go(Math.round(now) - 1);
  if (event.key === "ArrowRight") go(Math.round(now) + 1);
});
play(playing);
draw();
requestAnimationFrame(frame);
