// Pictures of the board and of the ball of orientations, on canvases. The room's axes are x right, y away, z up, as
// mpucal/session/attitude.py has them; a unit quaternion [w, x, y, z] takes the board's axes to the room's.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, k = 1) => a.map((v, i) => v + k * b[i]);
const radians = (degrees) => degrees * Math.PI / 180;
export const FLAT = [1, 0, 0, 0];
export const TURNED_OVER = [0, 1, 0, 0];

export function rotate([w, x, y, z], v) {
  const u = [x, y, z], t = cross(u, v).map((c) => 2 * c);
  return plus(plus(v, t, w), cross(u, t));
}

function times([a, b, c, d], [e, f, g, h]) {
  return [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];
}

// Returns the attitude between two, at the share s of the way (spherical interpolation).
export function between(p, q, s) {
  let cosine = p.reduce((sum, v, i) => sum + v * q[i], 0);
  const sign = cosine < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(1, Math.abs(cosine)));
  if (angle < 1e-4) return q;
  const a = Math.sin((1 - s) * angle) / Math.sin(angle), b = sign * Math.sin(s * angle) / Math.sin(angle);
  return p.map((v, i) => a * v + b * q[i]);
}

// Returns the turn from one attitude to another, as axis times angle in the room's axes.
export function turn(from, to) {
  let [w, x, y, z] = times(to, [from[0], -from[1], -from[2], -from[3]]);
  if (w < 0) [w, x, y, z] = [-w, -x, -y, -z];
  const sine = Math.hypot(x, y, z), angle = 2 * Math.atan2(sine, w);
  return sine < 1e-9 ? [0, 0, 0] : [x, y, z].map((v) => v * angle / sine);
}

// Returns the attitude nearest to `from` in which the direction `down` of the board points down.
export function pointing(down, from) {
  const v = rotate(from, down), axis = cross(v, [0, 0, -1]), sine = Math.hypot(...axis), angle = Math.atan2(sine, -v[2]);
  const [x, y, z] = sine < 1e-6 ? [0, angle > 1 ? 1 : 0, 0] : axis.map((c) => c * Math.sin(angle / 2) / sine);
  return times([sine < 1e-6 && angle > 1 ? 0 : Math.cos(angle / 2), x, y, z], from);
}

// The axes across, up and toward the eye of mpucal/terminal/view.py, which chooses from where the board is seen.
export function eye({ turn_deg, tilt_deg }) {
  const t = radians(turn_deg), e = radians(tilt_deg), away = [Math.sin(t), Math.cos(t), 0];
  return {
    across: [Math.cos(t), -Math.sin(t), 0],
    up: [away[0] * Math.sin(e), away[1] * Math.sin(e), Math.cos(e)],
    toward: [-away[0] * Math.cos(e), -away[1] * Math.cos(e), Math.sin(e)],
  };
}

// A model: a plate, boxes above and below it (lowest and highest corner, colour), and the print on both faces.
const GOLD = [214, 170, 60], BLACK = [38, 40, 44], STEEL = [150, 156, 162], SAND = [190, 160, 120];
const PINS = ["VCC", "GND", "SCL", "SDA", "XDA", "XCL", "AD0", "INT"];
const pinX = (k) => 0.8 * (2 * k / 7 - 1);
const box = (x, y, z, dx, dy, dz, colour) => ({ low: [x - dx, y - dy, z], high: [x + dx, y + dy, z + dz], colour });

function gy521() {
  const h = 0.05;
  return {
    half: [1, 0.76, h], colour: [18, 84, 160], pads: PINS.map((_, k) => [pinX(k), -0.62]),
    holes: [[-0.82, 0.57], [0.82, 0.57]],
    above: [
      box(0, 0.08, h, 0.2, 0.2, 0.1, BLACK),
      box(-0.5, 0.12, h, 0.06, 0.1, 0.06, SAND), box(0.42, 0.12, h, 0.06, 0.1, 0.06, SAND),
      box(-0.42, 0.5, h, 0.15, 0.09, 0.1, BLACK), box(0.34, -0.22, h, 0.1, 0.05, 0.05, STEEL),
      box(-0.3, -0.22, h, 0.1, 0.05, 0.05, STEEL), box(0.72, 0.1, h, 0.05, 0.09, 0.05, STEEL),
      ...PINS.map((_, k) => box(pinX(k), -0.62, h, 0.035, 0.035, 0.1, GOLD)),
    ],
    below: [
      box(0, -0.62, -h - 0.24, 0.93, 0.1, 0.24, BLACK),
      ...PINS.map((_, k) => box(pinX(k), -0.62, -h - 0.72, 0.035, 0.035, 0.48, GOLD)),
    ],
    printed: PINS.map((text, k) => ({ text, at: [pinX(k), -0.46], size: 0.1, steep: true })),
    dot: [-0.12, 0.2], arrows: true,
  };
}

function plainBoard() {
  return {
    half: [1, 0.7, 0.05], colour: [24, 110, 84], pads: [], holes: [], below: [], printed: [],
    above: [box(0, 0, 0.05, 0.22, 0.22, 0.1, BLACK)], dot: [-0.13, 0.13], arrows: true,
  };
}

// x to the nose, y to the right, z down: parts above the plate in flight have negative z.
function vehicle() {
  const arms = [[0.8, 0.8], [0.8, -0.8], [-0.8, 0.8], [-0.8, -0.8]];
  return {
    half: [0.62, 0.36, 0.1], colour: [92, 100, 110], pads: [], holes: [], printed: [], rods: arms,
    below: [
      box(0, 0, -0.32, 0.34, 0.24, 0.22, BLACK), box(0.5, 0, -0.22, 0.1, 0.2, 0.12, [220, 120, 30]),
      ...arms.map(([x, y], k) => box(x, y, -0.22, 0.12, 0.12, 0.3, k < 2 ? [220, 120, 30] : STEEL)),
    ],
    above: [box(0, 0.28, 0.1, 0.5, 0.05, 0.3, BLACK), box(0, -0.28, 0.1, 0.5, 0.05, 0.3, BLACK)],
    rotors: arms, arrows: false,
  };
}

const MODELS = { "gy-521": gy521(), plain: plainBoard(), vehicle: vehicle() };
const AXES = [["X", [1, 0, 0], "--x"], ["Y", [0, 1, 0], "--y"], ["Z", [0, 0, 1], "--z"]];
const LIGHT = [-0.35, 0.5, 0.79];  // across, up, toward the eye
const DISTANCE = 8, REACH = 1.6, FLOOR = -1.3, TABLE = { half: 0.75, lines: [-0.75, -0.375, 0, 0.375, 0.75] };

export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.style = getComputedStyle(canvas);
  }

  // Fits the canvas to its present size; drawings are centred at 0, 0.
  begin(reach) {
    const { canvas } = this, ratio = Math.min(devicePixelRatio || 1, 3);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.pen = canvas.getContext("2d");
    this.pen.setTransform(1, 0, 0, 1, 0, 0);
    this.pen.clearRect(0, 0, width, height);
    this.pen.translate(width / 2, height / 2);
    this.scale = Math.min(width, height) / 2 / reach;
    this.pixel = ratio;
    this.pen.lineJoin = this.pen.lineCap = "round";
  }

  ink(name) {
    return this.style.getPropertyValue(name);
  }

  look(view) {
    this.eye = eye(view);
  }

  // Returns a point of the room on the canvas, with some perspective.
  seen(point) {
    const k = this.scale * DISTANCE / (DISTANCE - dot(this.eye.toward, point));
    return [k * dot(this.eye.across, point), -k * dot(this.eye.up, point)];
  }

  // Returns the nearest place where a letter of this size is fully visible.
  inside(at, size) {
    const { width, height } = this.canvas, most = [width / 2 - 0.75 * size, height / 2 - 0.6 * size];
    return at.map((v, i) => Math.max(-most[i], Math.min(most[i], v)));
  }

  path(points, close = true) {
    this.pen.beginPath();
    points.forEach((point, k) => (k ? this.pen.lineTo(...point) : this.pen.moveTo(...point)));
    if (close) this.pen.closePath();
  }

  fill(points, colour, outline = true) {
    this.path(points);
    this.pen.fillStyle = colour;
    this.pen.fill();
    if (outline) {
      this.pen.strokeStyle = "rgba(0, 0, 0, .45)";
      this.pen.lineWidth = 0.7 * this.pixel;
      this.pen.stroke();
    }
  }

  // `around`: colour of a rim, which keeps words legible on any background.
  text(text, at, colour, size, around = null) {
    this.pen.fillStyle = colour;
    this.pen.font = `800 ${size}px system-ui, sans-serif`;
    this.pen.textAlign = "center";
    this.pen.textBaseline = "middle";
    if (around) {
      this.pen.strokeStyle = around;
      this.pen.lineWidth = 0.28 * size;
      this.pen.strokeText(text, ...at);
    }
    this.pen.fillText(text, ...at);
  }
}

// `small`: without axes and print.
export function drawBoard(picture, kind, attitude, view, way = null, small = false) {
  picture.begin(REACH);
  picture.look(view);
  const model = MODELS[kind] ?? MODELS.plain;
  const room = (point) => rotate(attitude, point);
  const at = (point) => picture.seen(room(point));
  if (!small) table(picture);
  shadow(picture, model, room);
  if (way) arc(picture, way);
  const normal = room([0, 0, 1]), top = dot(normal, picture.eye.toward) > 0.05;
  const [far, near] = top ? [model.below, model.above] : [model.above, model.below];
  boxes(picture, far, room);
  rods(picture, model, at);
  const [x, y, z] = model.half;
  boxes(picture, [{ low: [-x, -y, -z], high: [x, y, z], colour: model.colour }], room);
  if (!small) {
    print(picture, model, at, top);
    axis(picture, AXES[0], at, model, 1);
    axis(picture, AXES[1], at, model, 1);
  }
  boxes(picture, near, room);
  if (top && model.dot) spot(picture, at, [...model.dot, z + 0.1], 0.025, "#ddd");
  rotors(picture, model, at);
  if (!small) axis(picture, AXES[2], at, model, top ? 1 : -1);
  if (way) arc(picture, way, true);
}

// Draws the table below the board, whose near edge is the person's: it shows from where the picture is seen.
function table(picture) {
  const at = ([x, y]) => picture.seen([x, y, FLOOR]), { half, lines } = TABLE, line = picture.ink("--line");
  for (const k of lines) {
    stroke(picture, [at([k, -half]), at([k, half])], line, 0.02);
    stroke(picture, [at([-half, k]), at([half, k])], line, 0.02);
  }
  stroke(picture, [at([-half, -half]), at([half, -half])], picture.ink("--faint"), 0.05);
  label(picture, at, "you", [0, -0.75 * half], [1, 0], [0, 1], 0.2, picture.ink("--faint"));
}

function shadow(picture, model, room) {
  const [x, y] = model.half;
  const corners = [[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]].map(room).map(([a, b]) => picture.seen([a, b, FLOOR]));
  picture.fill(corners, "rgba(128, 128, 128, .2)", false);
}

const SIDES = [[0, 1], [0, -1], [1, 1], [1, -1], [2, 1], [2, -1]];

// The boxes are convex and do not overlap, so that drawing the farthest first is right.
function boxes(picture, list, room) {
  const { toward, across, up } = picture.eye;
  const depth = (b) => dot(toward, room(b.low.map((v, i) => (v + b.high[i]) / 2)));
  for (const b of [...list].sort((p, q) => depth(p) - depth(q))) {
    for (const [i, sign] of SIDES) {
      const outward = [0, 0, 0];
      outward[i] = sign;
      const [j, k] = [(i + 1) % 3, (i + 2) % 3], corners = [];
      for (const [p, q] of [[0, 0], [1, 0], [1, 1], [0, 1]]) {
        const corner = [0, 0, 0];
        corner[i] = sign > 0 ? b.high[i] : b.low[i];
        corner[j] = p ? b.high[j] : b.low[j];
        corner[k] = q ? b.high[k] : b.low[k];
        corners.push(room(corner));
      }
      const n = room(outward), from = plus(toward.map((v) => v * DISTANCE), corners[0], -1);
      if (dot(n, from) <= 0) continue;
      const lit = Math.max(0, dot([dot(n, across), dot(n, up), dot(n, toward)], LIGHT));
      const shade = 0.55 + 0.55 * lit;
      picture.fill(corners.map((c) => picture.seen(c)), `rgb(${b.colour.map((c) => Math.min(255, c * shade)).join()})`);
    }
  }
}

function print(picture, model, at, top) {
  const z = top ? model.half[2] : -model.half[2];
  for (const [x, y] of model.holes) spot(picture, at, [x, y, z], 0.12, picture.ink("--paper"), "rgba(214, 170, 60, .9)");
  for (const [x, y] of model.pads) spot(picture, at, [x, y, z], 0.07, "rgb(214, 170, 60)");
  if (!top) return;
  for (const { text, at: [x, y], size, steep } of model.printed) {
    label(picture, at, text, [x, y, z], steep ? [0, 1, 0] : [1, 0, 0], steep ? [-1, 0, 0] : [0, 1, 0], size);
  }
  if (!model.arrows) return;
  const from = [0.62, -0.28];
  for (const [name, [i, j]] of [["X", [1, 0]], ["Y", [0, 1]]]) {
    const tip = [from[0] + 0.24 * i, from[1] + 0.24 * j, z];
    stroke(picture, [at([...from, z]), at(tip)], "#fff", 0.028);
    head(picture, at([...from, z]), at(tip), "#fff", 0.07);
    label(picture, at, name, [from[0] + 0.32 * i - 0.1 * j, from[1] + 0.22 * j - 0.09 * i, z], [1, 0, 0], [0, 1, 0], 0.14);
  }
}

// Draws words that lie on the board, along one of its directions.
function label(picture, at, text, where, along, upward, size, colour = "rgba(255, 255, 255, .95)") {
  const { pen } = picture, o = at(where), a = at(plus(where, along, 0.1)), b = at(plus(where, upward, 0.1));
  pen.save();
  pen.transform((a[0] - o[0]) / 10, (a[1] - o[1]) / 10, (o[0] - b[0]) / 10, (o[1] - b[1]) / 10, o[0], o[1]);
  picture.text(text, [0, 0], colour, size * 100);
  pen.restore();
}

function spot(picture, at, [x, y, z], radius, colour, rim = null) {
  const points = Array.from({ length: 20 }, (_, k) => at([x + radius * Math.cos(k * Math.PI / 10), y + radius * Math.sin(k * Math.PI / 10), z]));
  picture.fill(points, colour, false);
  if (!rim) return;
  picture.pen.strokeStyle = rim;
  picture.pen.lineWidth = 0.035 * picture.scale;
  picture.pen.stroke();
}

function rods(picture, model, at) {
  for (const [x, y] of model.rods ?? []) stroke(picture, [at([0.3 * x, 0.3 * y, 0]), at([x, y, 0])], "rgb(110, 118, 128)", 0.1);
}

function rotors(picture, model, at) {
  for (const [x, y] of model.rotors ?? []) spot(picture, at, [x, y, -0.24], 0.45, "rgba(128, 140, 155, .28)", "rgba(128, 140, 155, .6)");
}

// Draws the part of an axis outside the board, and its letter; of z the half on the visible side.
function axis(picture, [name, direction, ink], at, model, sign) {
  const i = direction.indexOf(1), out = i === 2 ? (sign < 0) === Boolean(model.rotors) ? 0.35 : 0.15 : model.half[i];
  const along = (reach) => at(direction.map((v) => sign * v * reach)), from = along(out), [x, y] = along(out + (i === 2 ? 0.5 : 0.2));
  const colour = picture.ink(ink), size = Math.max(0.2 * picture.scale, 14 * picture.pixel), [u, v] = [x - from[0], y - from[1]];
  stroke(picture, [from, [x, y]], picture.ink("--paper"), 0.085);
  stroke(picture, [from, [x, y]], colour, 0.045);
  head(picture, from, [x, y], colour, 0.11);
  const beyond = (0.11 * picture.scale + 0.8 * size) / Math.max(Math.hypot(u, v), 1);
  picture.text(`${sign > 0 ? "+" : "−"}${name}`, picture.inside([x + u * beyond, y + v * beyond], size), colour, size, picture.ink("--paper"));
}

function stroke(picture, points, colour, width) {
  picture.path(points, false);
  picture.pen.strokeStyle = colour;
  picture.pen.lineWidth = width * picture.scale;
  picture.pen.stroke();
}

function head(picture, from, to, colour, size) {
  const [x, y] = [to[0] - from[0], to[1] - from[1]], length = Math.hypot(x, y);
  if (length < 1) return;
  const [u, v] = [x / length * size * picture.scale, y / length * size * picture.scale];
  picture.fill([[to[0] + u, to[1] + v], [to[0] - v * 0.8, to[1] + u * 0.8], [to[0] + v * 0.8, to[1] - u * 0.8]], colour, false);
}

// Draws an arc along the missing turn of the board's top, thicker where it is nearer; `over`: only what lies before the
// board, and a trace of the rest.
function arc(picture, way, over = false) {
  const angle = Math.hypot(...way);
  if (angle < radians(12)) return;
  const axis = way.map((v) => v / angle), points = [], near = [], { pen } = picture;
  for (let k = 0; k <= 24; k++) {
    const half = angle * k / 48, s = Math.sin(half), point = rotate([Math.cos(half), axis[0] * s, axis[1] * s, axis[2] * s], [0, 0, 1.3]);
    points.push(picture.seen(point));
    near.push(dot(picture.eye.toward, point));
  }
  const colour = picture.ink("--goal"), size = (k) => 1 + 0.45 * near[k], shown = (k, least = 0) => !over || near[k] >= least;
  if (over) {
    pen.globalAlpha = 0.35;
    stroke(picture, points, colour, 0.035);
    if (!shown(24)) head(picture, points[21], points[24], colour, 0.2 * size(24));
    pen.globalAlpha = 1;
  }
  // The end of the rim is drawn over.
  for (const [ink, width, least] of [[picture.ink("--paper"), 0.15, 0], [colour, 0.085, -0.2]]) {
    for (let k = 0; k < 24; k++) if (shown(k + 1, least)) stroke(picture, points.slice(k, k + 2), ink, width * size(k));
  }
  if (shown(24)) head(picture, points[21], points[24], colour, 0.2 * size(24));
}

// The sphere of directions that can point down, fixed to the board and seen from a little below: the direction that
// points down now is at its foot.
const BALL_VIEW = { turn_deg: -20, tilt_deg: -28 };

export function drawBall(picture, attitude, taken, wanted) {
  picture.begin(1.28);
  picture.look(BALL_VIEW);
  const { pen, scale } = picture, room = (v) => rotate(attitude, v);
  const front = (v) => dot(room(v), picture.eye.toward) > 0;
  const flat = (v) => [scale * dot(picture.eye.across, room(v)), -scale * dot(picture.eye.up, room(v))];
  pen.beginPath();
  pen.arc(0, 0, scale, 0, 2 * Math.PI);
  pen.fillStyle = picture.ink("--raised");
  pen.fill();
  pen.strokeStyle = picture.ink("--faint");
  pen.lineWidth = 1.5 * picture.pixel;
  pen.stroke();
  for (const behind of [true, false]) {
    pen.globalAlpha = behind ? 0.3 : 1;
    for (let i = 0; i < 3; i++) circle(picture, i, front, flat, behind);
    for (const [name, direction, ink] of AXES) {
      for (const sign of [1, -1]) {
        const tip = direction.map((v) => sign * v);
        if (front(tip) === behind) continue;
        picture.text(`${sign > 0 ? "+" : "−"}${name}`, flat(tip), picture.ink(ink), Math.max(0.2 * scale, 11 * picture.pixel));
      }
    }
    for (const { down, paused } of taken) {
      if (front(down) !== behind) dab(picture, flat(down), paused ? 0.085 : 0.04, picture.ink("--good"));
    }
    if (wanted && front(wanted) !== behind) {
      dab(picture, flat(wanted), 0.13, null, picture.ink("--goal"));
      dab(picture, flat(wanted), 0.05, picture.ink("--goal"));
    }
  }
  pen.globalAlpha = 1;
  const foot = [scale * dot(picture.eye.across, [0, 0, -1]), -scale * dot(picture.eye.up, [0, 0, -1])];
  dab(picture, foot, 0.16, null, picture.ink("--now"));
  stroke(picture, [[foot[0], foot[1] + 0.17 * scale], [foot[0], 1.22 * scale]], picture.ink("--now"), 0.04);
}

function circle(picture, i, front, flat, behind) {
  const { pen } = picture;
  pen.beginPath();
  let down = false;
  for (let k = 0; k <= 72; k++) {
    const v = [0, 0, 0], t = k * Math.PI / 36;
    v[(i + 1) % 3] = Math.cos(t);
    v[(i + 2) % 3] = Math.sin(t);
    const shown = front(v) !== behind;
    if (shown) down ? pen.lineTo(...flat(v)) : pen.moveTo(...flat(v));
    down = shown;
  }
  pen.strokeStyle = picture.ink("--line");
  pen.lineWidth = 1.2 * picture.pixel;
  pen.stroke();
}

function dab(picture, at, radius, colour, rim = null) {
  const { pen } = picture;
  pen.beginPath();
  pen.arc(...at, radius * picture.scale, 0, 2 * Math.PI);
  if (colour) {
    pen.fillStyle = colour;
    pen.fill();
  }
  if (!rim) return;
  pen.strokeStyle = rim;
  pen.lineWidth = 0.045 * picture.scale;
  pen.stroke();
}
