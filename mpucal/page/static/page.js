// The page: changes from the server are shown at once; the board moves to its new attitude by an animation.

import { FLAT, TURNED_OVER, Picture, between, drawBall, drawBoard, pointing, turn } from "./board.js";
import * as sound from "./sound.js";

const $ = (id) => document.getElementById(id);
// The attitude comes four times a second; the animation takes a little less.
const MOVE_MS = 230;
// From this angle [rad] on a turn the other way round is about as short.
const NEARLY_ROUND = 2.6;
// The server sends at least every two seconds: after this silence the connection counts as lost.
const SILENCE_MS = 5000, REOPEN_MS = 1500;
// Verdicts on a calibration; the others are those of a check.
const CALIBRATED = ["good", "usable", "refused"];
const FINE = ["good", "usable", "still good"];
const REPORT = "report.html";
// The axes in brackets are for the eye.
const AXES = / \([+−][^)]*\)/g;
const SAVE_AT_ONCE_BYTES = 2e7;
let state = {}, source = null, heardAt = 0, fresh = false;

// The connection

function open() {
  source?.close();
  fresh = true;
  source = new EventSource("events");
  source.onmessage = (event) => hear(JSON.parse(event.data));
  source.onerror = () => {
    if (!state.ended) lost("Connection lost. Trying again …");
    if (source.readyState === EventSource.CLOSED && !state.ended) setTimeout(open, REOPEN_MS);
  };
  heardAt = performance.now();
}

function lost(words) {
  if ($("lost").hidden) announce(words, "wrong");
  $("lost").textContent = words;
  $("lost").hidden = false;
}

function watch() {
  if (state.ended || performance.now() - heardAt < SILENCE_MS) return;
  lost("Connection lost. Trying again …");
  open();
}

function hear(changed) {
  heardAt = performance.now();
  if (!$("lost").hidden) $("lost").hidden = true;
  const old = state;
  // The first message holds all values.
  state = fresh ? changed : { ...state, ...changed };
  const begins = fresh;
  fresh = false;
  if (Object.keys(changed).length === 0) return;
  show(changed);
  if (!begins || Object.keys(old).length) tellChanges(old, begins);
  if (state.ended) end();
}

// What is shown

function show(changed) {
  document.title = state.title ? `${state.headline ?? "mpucal"} – ${state.title}` : "mpucal";
  put("title", state.title ?? "mpucal");
  put("facts", facts());
  $("keys").hidden = !state.keys || Boolean(state.verdict || state.stopped || state.ended);
  task();
  line();
  caution();
  if (changed.known !== undefined) known();
  if (changed.notes !== undefined) notes();
  if (changed.live !== undefined) live();
  if (changed.verdict || changed.results) result();
  pictures(changed);
}

// The finish line: a picture of each orientation, ticked as it is taken; that of the next is marked.
let lined = "";

function line() {
  const [taken, of] = state.line ?? [0, 0], verifying = state.prompt?.kind === "verify";
  const done = state.verdict || state.stopped || state.ended;
  $("line").hidden = !of || Boolean(done);
  const held = verifying ? [] : [state.meter && flatDown(), ...(state.seen ?? []).filter((seen) => seen.paused).map((seen) => seen.down)];
  const downs = Array.from({ length: of }, (_, k) => (k < taken ? held[k] : k === taken ? target() : null) ?? null);
  const key = JSON.stringify([taken, downs, innerWidth, dark.matches]);
  if (key === lined || $("line").hidden) return;
  lined = key;
  $("line").setAttribute("aria-label", `${taken} of ${of} orientations taken`);
  $("line").replaceChildren(...downs.map((down, k) => {
    const mark = element("i", "", k < taken ? "taken" : k === taken ? "next" : "");
    mark.append(document.createElement("canvas"));
    return mark;
  }));
  downs.forEach((down, k) => {
    const canvas = $("line").children[k].firstChild;
    if (down) drawBoard(new Picture(canvas), state.board, pointing(down, flat()), LINE_VIEW, null, true);
  });
}

function put(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

function facts() {
  const { meter } = state;
  if (!meter) return "";
  const s = Math.max(0, Math.floor(meter.t_s - (state.begun_s ?? 0)));
  const warm = meter.temperature_c === null ? "" : `${meter.temperature_c.toFixed(1)} °C · `;
  return `${meter.rate_hz.toFixed(1)} Hz · ${warm}${Math.floor(s / 60)}:${String(s % 60).padStart(2, "0")}`;
}

function task() {
  if (state.live) {
    document.body.dataset.look = "live";
    put("headline", `${state.live.magnitude.toFixed(3)} m/s²`);
    put("prompt", state.ended ? "The stream has ended." : "|a|, calibrated");
    return;
  }
  const done = state.verdict ?? (state.stopped || state.ended ? "stopped" : "");
  document.body.dataset.verdict = done;
  const { look, share, number } = done ? { look: FINE.includes(done) ? "yes" : "no", share: 1 } : dial();
  document.body.dataset.look = look;
  put("headline", state.verdict ? verdict() : done ? "Stopped" : state.headline ?? "Connecting");
  put("prompt", done ? state.stopped ?? state.estimated_error ?? "" : promptWords());
  put("step", done ? "" : state.confirming || (state.count ?? ""));
  put("number", number ?? "");
  $("arc").setAttribute("stroke-dasharray", `${Math.max(0, Math.min(100, 100 * share))} 100`);
  if (look === "turn") $("way").setAttribute("transform", `rotate(${Math.atan2(...said()) * 180 / Math.PI})`);
}

// Returns the form of the dial, the drawn share of its ring, and its number.
function dial() {
  const { moment, meter, countdown, held, progress } = state;
  switch (moment) {
    case "counting":
      return { look: "hold", share: countdown.remaining_s / countdown.of_s, number: String(Math.ceil(countdown.remaining_s) || "") };
    case "decided":
      return held.use === "seen" ? { look: "again", share: 1 } : { look: "yes", share: 1 };
    case "turn":
      return { look: "turn", share: meter.missing_deg / 180, number: `${5 * Math.round(meter.missing_deg / 5)}°` };
    case "near":
      return { look: "hold", share: 1, number: `${Math.round(meter.missing_deg)}°` };
    case "step":
      if (progress?.of) return { look: "step", share: progress.done / progress.of, number: laying() ? String(Math.ceil(progress.of - progress.done)) : "" };
  }
  return { look: "wait", share: 1 };
}

function promptWords() {
  const { countdown, moment, prompt } = state;
  if (moment === "counting" && countdown?.elsewhere) return "Not the wanted orientation, but a new and useful one.";
  return prompt?.text ?? "";
}

// Returns the direction in which the top is said to turn: to the right, and away from the person.
function said() {
  const words = state.meter.turn, has = (word) => Number(words.includes(word));
  return [has("right") - has("left"), has("away") - has("toward")];
}

// Returns the turn to the wanted attitude. Near half a turn both ways round are about as short, and the words decide.
function way(attitude) {
  const rotation = turn(attitude, state.meter.wanted), angle = Math.hypot(...rotation), [right, away] = said();
  const against = right * rotation[1] - away * rotation[0] < 0;
  return against && angle > NEARLY_ROUND ? rotation.map((v) => v * (1 - 2 * Math.PI / angle)) : rotation;
}

function caution() {
  const { caution: now, meter } = state;
  const shown = now && meter && meter.t_s - now.t_s < 6 && !state.verdict;
  $("caution").hidden = !shown;
  if (shown) {
    put("what", `${capital(now.what)}:`);
    put("do", now.do);
  }
}

function element(name, words = "", kind = "") {
  const made = document.createElement(name);
  made.textContent = words;
  if (kind) made.className = kind;
  return made;
}

// Standard uncertainties on a logarithmic scale: a bar begins at a thousand times the target, and is full at the target.
function known() {
  $("known").hidden = !state.known;
  $("known").replaceChildren(...(state.known ?? []).map((group) => {
    const made = element("div", "", "group"), name = element("div", "", "group-name");
    name.append(element("span", group.name), element("b", group.axes[group.worst].text));
    made.append(name);
    group.axes.forEach(({ times, text, reached }, i) => {
      const row = element("div", "", reached ? "axis reached" : "axis"), bar = element("div", "", "bar"), full = element("span");
      full.style.width = `${100 * Math.max(0.02, Math.min(1, 1 - Math.log10(times) / 3))}%`;
      bar.setAttribute("role", "img");
      bar.setAttribute("aria-label", `${group.name} ${"xyz"[i]} ${text}, target ${group.target}`);
      bar.append(full);
      row.append(element("i", "xyz"[i]), bar, element("u", reached ? "✓" : ""));
      made.append(row);
    });
    made.append(element("div", `target ${group.target} (1 sigma)`, "target"));
    return made;
  }));
}

function notes() {
  $("talk").hidden = !state.notes.length;
  $("notes").replaceChildren(...state.notes.map((note) => element("li", note)));
}

function live() {
  const { acc, gyr } = state.live, rows = [["a", acc, "m/s²", 3]];
  if (gyr) rows.push(["ω", gyr.map((v) => v * 180 / Math.PI), "deg/s", 2]);
  $("live").hidden = false;
  $("live").replaceChildren(...rows.flatMap(([name, values, unit, digits]) => values.map((value, i) =>
    element("div", `${name} ${"xyz"[i]}  ${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)} ${unit}`))));
}

// The pictures

const now = new Picture($("now")), goal = new Picture($("goal")), ball = new Picture($("ball"));
const still = matchMedia("(prefers-reduced-motion: reduce)");
let from = FLAT, to = FLAT, movedAt = 0, seenFrom = {}, drawing = false;

const LINE_VIEW = { turn_deg: -28, tilt_deg: 40 };
const dark = matchMedia("(prefers-color-scheme: dark)");
const flatDown = () => (state.board === "vehicle" ? [0, 0, 1] : [0, 0, -1]);
const flat = () => (state.board === "vehicle" ? TURNED_OVER : FLAT);
const laying = () => state.prompt?.kind === "lay_flat";
const wanted = () => state.meter?.wanted ?? (laying() ? flat() : null);

function pictures(changed) {
  const { meter, prompt } = state;
  const ended = state.verdict || state.stopped;
  $("pictures").hidden = !meter || Boolean(ended);
  const goes = wanted();
  $("goal-figure").hidden = !goes;
  $("pictures").classList.toggle("alone", !goes);
  document.body.toggleAttribute("data-early", !state.known && !state.live);
  put("goal-caption", laying() ? state.flat : "turn it like this");
  $("ball-figure").hidden = !meter || !state.seen?.length;
  put("ball-caption", `orientations taken${!ended && target() ? "; ring: the next" : ""}`);
  $("ball").setAttribute("aria-label", "orientations taken");
  $("now").setAttribute("aria-label", meter?.turn ? `the board now; missing: ${meter.turn}` : "the board now");
  $("goal").setAttribute("aria-label", prompt?.text ?? "");
  if (changed.meter?.attitude) {
    from = still.matches || document.hidden ? changed.meter.attitude : shownAttitude(performance.now());
    to = changed.meter.attitude;
    movedAt = performance.now();
  }
  seenFrom = { ...state.eye, ...seenFrom };
  draw();
}

const shownAttitude = (t) => between(from, to, Math.min(1, (t - movedAt) / MOVE_MS));

function draw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(frame);
}

function frame(t) {
  drawing = false;
  const attitude = shownAttitude(performance.now()), goes = wanted();
  const k = still.matches ? 1 : 0.14;
  for (const name in seenFrom) seenFrom[name] += k * (state.eye[name] - seenFrom[name]);
  if (!$("pictures").hidden) {
    drawBoard(now, state.board, attitude, seenFrom, goes && state.meter?.wanted ? way(attitude) : null);
    if (goes) drawBoard(goal, state.board, goes, seenFrom);
  }
  if (!$("ball-figure").hidden) drawBall(ball, attitude, state.seen ?? [], state.verdict ? null : target());
  const moving = performance.now() - movedAt < MOVE_MS || Object.keys(seenFrom).some((name) => Math.abs(state.eye[name] - seenFrom[name]) > 0.1);
  if (moving && !document.hidden) draw();
}

const target = () => (state.meter?.wanted ? state.prompt?.down ?? state.knowledge?.down ?? null : null);

// The result

function result() {
  $("result").hidden = !state.verdict;
  // The message of a reason ends with its remedy, which is shown apart.
  $("reasons").replaceChildren(...(state.reasons ?? []).map(({ message, remedy }) => {
    const reason = element("li");
    reason.append(element("strong", sentence(message.replace(`; ${remedy}`, ""))), " ", sentence(remedy));
    return reason;
  }));
  put("summary", state.summary ?? "");
  $("summary").parentElement.hidden = !state.summary;
  $("values").hidden = !state.values?.length;
  $("values").tBodies[0].replaceChildren(...(state.values ?? []).map(([name, cells]) => {
    const row = element("tr"), head = element("th", name);
    head.scope = "row";
    row.append(head, ...cells.map((cell) => element("td", cell.replace("± ", "±\u00a0"))));
    return row;
  }));
  if (state.results && !$("results").childElementCount) $("results").append(...reportFirst(state.results).flatMap(file));
}

const capital = (words) => words[0].toUpperCase() + words.slice(1);
const sentence = (words) => `${capital(words)}.`;
const verdict = () => (CALIBRATED.includes(state.verdict) ? `The calibration is ${state.verdict}.` : sentence(state.verdict));
const reportFirst = (files) => [...files].sort((a, b) => (b.name === REPORT) - (a.name === REPORT));
const size = (bytes) => (bytes > 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.ceil(bytes / 1e3)} kB`);

// Results that are not large are fetched at once, so that they can still be saved after the end of the session.
function file({ name, bytes }) {
  const path = `results/${name}`, items = [];
  if (name === REPORT) items.push(link("Open the report", path, "first live", { target: "_blank", rel: "noopener" }));
  const save = link(name, path, "", { download: name });
  save.firstChild.append(" ", element("small", size(bytes)));
  items.push(save);
  if (bytes <= SAVE_AT_ONCE_BYTES) {
    fetching.push(fetch(path).then((reply) => reply.blob()).then((blob) => {
      save.firstChild.href = URL.createObjectURL(blob);
    }).catch(() => {}));
  }
  return items;
}

function link(words, href, kind, more) {
  const item = element("li"), a = element("a", words, kind);
  Object.assign(a, { href }, more);
  item.append(a);
  return item;
}

const fetching = [];

async function end() {
  await Promise.allSettled(fetching);
  source.close();
  for (const gone of document.querySelectorAll("a.live")) gone.parentElement.remove();
}

// Announcements: aloud if sound is on, and for screen readers

function announce(words, tone = null) {
  if (tone) sound.tone(tone);
  if (!words) return;
  const spoken = words.replace(AXES, "");
  put("spoken", spoken);
  sound.say(spoken);
}

function tellChanges(old, begins) {
  if (state.verdict !== old.verdict && state.verdict) return announce(verdict(), FINE.includes(state.verdict) ? "done" : "wrong");
  if (state.stopped !== old.stopped && state.stopped) return announce(state.stopped, "wrong");
  if (state.verdict || state.stopped || state.live || begins) return;
  if (state.said && state.said.number !== old.said?.number) announce(state.said.words, state.said.tone);
}

// Keys

$("sound").addEventListener("click", () => {
  const on = sound.toggle();
  $("sound").setAttribute("aria-pressed", on);
  put("sound", on ? "Sound is on" : "Sound is off");
});

for (const button of $("keys").children) {
  const words = button.textContent;
  button.addEventListener("click", () => {
    const { key, sure } = button.dataset;
    if (sure && button.textContent !== sure) {
      button.textContent = sure;
      setTimeout(() => (button.textContent = words), 3000);
      return;
    }
    button.textContent = words;
    fetch(`keys/${key}`, { method: "POST" }).catch(() => lost("The key did not arrive. Trying again …"));
  });
}

for (const woken of ["visibilitychange", "pageshow", "online", "focus"]) {
  addEventListener(woken, () => {
    if (!document.hidden) {
      watch();
      draw();
    }
  }, true);
}
addEventListener("resize", () => {
  line();
  draw();
});
dark.addEventListener("change", () => {
  line();
  draw();
});
setInterval(watch, 1000);
open();
