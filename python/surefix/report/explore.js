"use strict";
// Joins the figures of an interactive report: one chosen query, one chosen method, and its
// threshold. The numbers are those of the page's data; nothing is estimated here but counts.
(() => {
const data = JSON.parse(document.getElementById("explorer-data").textContent);
const $ = (id) => document.getElementById(`explorer-${id}`);
const root = document.documentElement;
const dark = matchMedia("(prefers-color-scheme: dark)");
const m = data.queries;
// Rows of the strip, in its units and in pixels.
const ROW = 48, BAR = 0.27, AXIS = 46;
// The bits of a query's state in each method.
const READY = 1, ACCEPTED = 2, JUDGED = 4, RIGHT = 8;

let fig, common, methods, query = 0, chosen = 0, pinned = false, theme = data.themes[0];

const part = (figure, name) => figure.select_one(name);
const fill = (figure, name, columns) => { part(figure, name).data_source.data = columns; };
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
const digits = (value) => Number(value.toPrecision(4)).toString();
const share = (value) => value.toFixed(3);
const named = (index, names) => names && names[index] !== String(index) ? names[index] : "";

// A place, of several segments counted from the start of its own.
function placed(place) {
  const starts = data.starts;
  if (starts.length < 2) return String(place);
  let k = starts.length - 1;
  while (starts[k] > place) k--;
  return `${place - starts[k]} of segment ${k}`;
}

// A method's threshold: its position counts the steps of its curve, 0 for none accepted.
const limit = (method) => method.at ? method.thresholds[method.at - 1] : -Infinity;
const has = (method, j, bit) => (method.state[j] & bit) !== 0;
const taken = (method, j) =>
  has(method, j, READY) && has(method, j, ACCEPTED) && method.score[j] <= limit(method);

function figures(k) {
  const method = methods[k];
  if (method.recall) {
    return method.at
      ? { precision: method.precision[method.at - 1], recall: method.recall[method.at - 1] }
      : { precision: null, recall: 0 };
  }
  let sum = 0, count = 0;
  if (method.confidence) {
    for (let j = 0; j < m; j++) if (taken(method, j)) { sum += method.confidence[j]; count++; }
  }
  return { confidence: count ? sum / count : null };
}

function count(method) {
  let accepted = 0, right = 0, wrong = 0;
  for (let j = 0; j < m; j++) {
    if (!taken(method, j)) continue;
    accepted++;
    if (has(method, j, JUDGED)) has(method, j, RIGHT) ? right++ : wrong++;
  }
  return { accepted, right, wrong };
}

// The look of a mark: hue says right or wrong, strength trusted or not.
function look(method, j) {
  const trusted = common.trusted[j] !== 0;
  if (data.judged && has(method, j, JUDGED)) {
    const right = has(method, j, RIGHT);
    const name = `${trusted ? "trusted" : "untrusted"}_${right ? "right" : "wrong"}`;
    return { color: theme[name], marker: right ? "circle" : "x", solid: right && trusted,
             size: right ? 5 : trusted ? 10 : 6 };
  }
  const told = !data.judged && trusted;
  return { color: told ? theme.trusted : theme.muted, marker: "circle", solid: told, size: 5 };
}

// On the plan, a match says little if the method believes that the robot is off the map.
const lost = (method, j) => Boolean(method.off_map) && method.off_map[j] >= 0.5;

function marks(figure, xs, ys) {
  const method = methods[chosen];
  const columns = { x: [], y: [], color: [], fill: [], alpha: [], size: [], marker: [] };
  const small = m > 3000 ? 0.6 : 1;
  // Wrong ones come last, on top.
  for (const wrong of [false, true]) {
    for (let j = 0; j < m; j++) {
      if (!has(method, j, READY)) continue;
      const own = figure === fig.plan && lost(method, j)
        ? { color: theme.muted, marker: "square", solid: false, size: 7 } : look(method, j);
      if ((own.marker === "x") !== wrong) continue;
      columns.x.push(xs(j));
      columns.y.push(ys(j));
      columns.color.push(own.color);
      columns.fill.push(own.solid ? own.color : "rgba(0,0,0,0)");
      columns.alpha.push(taken(method, j) ? 1 : 0.16);
      columns.size.push(own.size * small);
      columns.marker.push(own.marker);
    }
  }
  fill(figure, "marks", columns);
}

function drawMarks() {
  const { place } = methods[chosen];
  marks(fig.matrix, (j) => j, (j) => place[j]);
  if (fig.plan) marks(fig.plan, (j) => common.east[place[j]], (j) => common.north[place[j]]);
}

function drawStrip() {
  const shown = methods.filter((method) => method.on), whole = !data.judged;
  const rows = shown.map((method) => ({ name: method.name, whole, bar: (j) => {
    if (!has(method, j, READY)) return null;
    if (!data.judged) {
      const top = method.confidence ? 2 * method.confidence[j] - 1 : 0;
      return [-1, top, theme.ink, taken(method, j) ? 0.75 : 0.2];
    }
    if (!has(method, j, JUDGED)) return [-0.08, 0.08, theme.muted, 0.5];
    const right = has(method, j, RIGHT);
    const colour = right ? theme.trusted_right : theme.trusted_wrong;
    return [right ? 0 : -1, right ? 1 : 0, colour, taken(method, j) ? 1 : 0.22];
  } }));
  rows.push({ name: data.judged ? "trusted single matches" : "trusted", whole, bar: (j) => {
    if (!common.trusted[j]) return null;
    if (!data.judged) return [-1, 0, theme.trusted, 1];
    const right = common.single_right[j] !== 0;
    return [right ? 0 : -1, right ? 1 : 0, right ? theme.trusted_right : theme.trusted_wrong, 1];
  } });
  const says = methods[chosen].off_map;
  if (says || (common.off_map && common.off_map.includes(1))) {
    const name = !says ? "off the map" : data.judged
      ? `off the map: block, and ${methods[chosen].name}'s belief` : "belief to be off the map";
    rows.push({ name, whole: true, bar: (j) => says ? [-1, 2 * says[j] - 1, theme.ink, 0.75] : null,
      under: (j) => common.off_map && common.off_map[j] ? [-1, 1, theme.muted, 0.3] : null });
  }
  const bars = { left: [], right: [], bottom: [], top: [], color: [], alpha: [] };
  const labels = { x: [], y: [], text: [] }, middles = { x0: [], x1: [], y: [] };
  rows.forEach((row, r) => {
    const middle = rows.length - r - 0.64;
    labels.y.push(rows.length - r - 0.16);
    labels.text.push(row.name);
    labels.x.push(fig.strip.x_range.start);
    middles.y.push(row.whole ? middle - BAR : middle);
    middles.x0.push(-0.5);
    middles.x1.push(m - 0.5);
    for (const bar of [row.under, row.bar]) {
      if (!bar) continue;
      // Neighbours that look alike are one bar.
      let last = null, start = 0;
      for (let j = 0; j <= m; j++) {
        const now = j < m ? bar(j) : null;
        if (last && !(now && now.every((value, k) => value === last[k]))) {
          bars.left.push(start - 0.5);
          bars.right.push(j - 0.5);
          bars.bottom.push(middle + BAR * last[0]);
          bars.top.push(middle + BAR * last[1]);
          bars.color.push(last[2]);
          bars.alpha.push(last[3]);
          last = null;
        }
        if (now && !last) { last = now; start = j; }
      }
    }
  });
  fig.strip.y_range.setv({ start: 0, end: rows.length });
  fig.strip.height = ROW * rows.length + AXIS;
  fill(fig.strip, "bars", bars);
  fill(fig.strip, "names", labels);
  fill(fig.strip, "middles", middles);
}

function drawCurves() {
  if (!fig.curve) return;
  const columns = { xs: [], ys: [], color: [], dash: [], width: [] };
  methods.forEach((method, k) => {
    if (!method.on || !method.recall) return;
    columns.xs.push(Array.from(method.recall));
    columns.ys.push(Array.from(method.precision));
    columns.color.push(theme.lines[k].color);
    columns.dash.push(theme.lines[k].dash);
    columns.width.push(theme.lines[k].width + (k === chosen ? 1.2 : 0));
  });
  fill(fig.curve, "curves", columns);
}

function drawThreshold() {
  const method = methods[chosen], slider = $("threshold");
  const now = figures(chosen), counts = count(method);
  slider.max = method.thresholds.length;
  slider.value = method.at;
  // A tracker's score is what its confidence lacks of 1.
  const by = method.confidence ? "least confidence" : "threshold";
  const bound = method.confidence ? 1 - limit(method) : limit(method);
  const score = method.at ? digits(bound) : "none";
  $("score").textContent = score;
  $("by").textContent = by;
  $("accepted").textContent = `${counts.accepted}`;
  const words = [`${by} ${score}`, `${counts.accepted} accepted`];
  if (data.judged) {
    $("precision").textContent = now.precision === null ? "none" : share(now.precision);
    $("recall").textContent = share(now.recall);
    // As the curve has them, to the last bit.
    for (const name of ["precision", "recall"]) $(name).dataset.exact = String(now[name]);
    $("wrong").textContent = String(counts.wrong);
    words.push(`precision ${$("precision").textContent}`, `recall ${$("recall").textContent}`);
  } else {
    $("confidence").textContent = now.confidence === null ? "none" : share(now.confidence);
  }
  slider.setAttribute("aria-valuetext", words.join(", "));
  methods.forEach((each, k) => {
    const row = document.querySelectorAll("#explorer-methods tbody tr")[k], own = figures(k);
    const cells = row.querySelectorAll("td.number");
    cells[0].textContent = String(count(each).accepted);
    if (data.judged) {
      cells[1].textContent = own.precision === null ? "none" : share(own.precision);
      cells[2].textContent = share(own.recall);
    }
    row.classList.toggle("chosen", k === chosen);
    row.classList.toggle("off", !each.on);
  });
  if (fig.curve) {
    const at = method.recall && method.at;
    fill(fig.curve, "point", at ? { x: [now.recall], y: [now.precision] } : { x: [], y: [] });
  }
}

function nearest(album, number) {
  const { numbers, files } = album;
  if (!numbers.length || number < 0) return null;
  let low = 0, high = numbers.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (numbers[middle] < number) low = middle + 1; else high = middle;
  }
  if (low > 0 && number - numbers[low - 1] <= numbers[low] - number) low--;
  return { number: numbers[low], source: `data:image/jpeg;base64,${files[low]}` };
}

function picture(id, album, number, words, names, told = String) {
  const box = $(id), found = nearest(album, number), name = named(number, names);
  box.hidden = number < 0;
  if (number < 0) return;
  const image = box.querySelector("img"), caption = box.querySelector("figcaption");
  image.hidden = !found;
  box.querySelector(".none").hidden = Boolean(found);
  if (found) {
    image.src = found.source;
    image.alt = `${words} ${told(number)}`;
  }
  const other = found && found.number !== number ? ` (image of ${told(found.number)}, the nearest)` : "";
  caption.replaceChildren(document.createTextNode(`${words} ${told(number)}${other}`));
  if (name) {
    const small = document.createElement("span");
    small.textContent = name;
    caption.append(small);
  }
}

function fact(id, value) {
  const row = $(id);
  row.hidden = value === null || value === undefined || Number.isNaN(value);
  if (!row.hidden) row.querySelector("dd").textContent = value;
}

function verdict(method, place) {
  const trusted = common.trusted[query] ? "trusted" : "not trusted";
  if (!has(method, query, READY)) return ["no answer yet", "muted"];
  const refused = taken(method, query) ? "" : ", refused";
  if (!data.judged) return [trusted + refused, common.trusted[query] ? "trusted" : "muted"];
  if (!has(method, query, JUDGED)) return ["not judged", "muted"];
  if (has(method, query, RIGHT)) return [`right, ${trusted}${refused}`, "right"];
  const off = common.true_place[query] < 0 ? "not on the map" : apart(place);
  return [`wrong: ${off}, ${trusted}${refused}`, "wrong"];
}

function apart(place) {
  if (common.query_east && fig.plan) {
    const east = common.east[place] - common.query_east[query];
    const north = common.north[place] - common.query_north[query];
    return `${Math.round(Math.hypot(east, north))} m off`;
  }
  const off = Math.abs(place - common.true_place[query]);
  return off === 1 ? "1 place off" : `${off} places off`;
}

function drawQuery() {
  const method = methods[chosen], place = method.place[query];
  const truth = data.judged ? common.true_place[query] : -1;
  const [words, kind] = verdict(method, place);
  const name = named(query, data.queryNames);
  $("pair-title").textContent = `Query ${query}`;
  $("verdict").textContent = words;
  $("verdict").dataset.kind = kind;
  picture("image-query", data.images[0], query, "query", data.queryNames);
  const ready = has(method, query, READY);
  picture("image-match", data.images[1], ready ? place : -1, "match", data.placeNames,
          placed);
  picture("image-true", data.images[1], kind === "wrong" ? truth : -1, "true place",
          data.placeNames, placed);
  $("query").value = query;
  const answer = `query ${query}${name && ` ${name}`}, place ${ready ? placed(place) : "none"}: ${words}`;
  $("query").setAttribute("aria-valuetext", answer);
  fact("fact-method", method.name);
  fact("fact-score", ready ? digits(method.score[query]) : null);
  fact("fact-confidence", method.confidence ? share(method.confidence[query]) : null);
  fact("fact-off", method.off_map ? share(method.off_map[query]) : null);
  fact("fact-distance", ready && method.distance ? digits(method.distance[query]) : null);
  const single = `${digits(common.single_distance[query])}, place ${placed(common.single_place[query])}`;
  fact("fact-single", single);
  fact("fact-true", common.true_distance && truth >= 0
    ? `${digits(common.true_distance[query])}, place ${placed(truth)}` : null);

  part(fig.matrix, "here").location = query;
  part(fig.strip, "here").location = query;
  const ring = { x: [], y: [], size: [], color: [] };
  const circle = (columns, x, y, size, color) => {
    columns.x.push(x); columns.y.push(y); columns.size.push(size); columns.color.push(color);
  };
  if (truth >= 0 && kind === "wrong") circle(ring, query, truth, 10, theme.truth);
  if (ready) circle(ring, query, place, 15, theme.ink);
  fill(fig.matrix, "ring", ring);

  const values = part(fig.matrix, "tones").data_source.data.image[0];
  const [down, across] = data.block, column = Math.floor(query / across);
  const xs = [], ys = [];
  for (let row = 0; row < data.rows; row++) {
    xs.push(Math.min(data.places - 1, row * down + (down - 1) / 2));
    ys.push(data.low + data.step * values[row * data.columns + column]);
  }
  fill(fig.profile, "distances", { x: xs, y: ys });
  part(fig.profile, "match").setv({ location: ready ? place : null, line_color: theme[kind] });
  const off = kind === "wrong" && truth >= 0;
  part(fig.profile, "true").setv({ location: off ? truth : null });

  if (fig.plan) {
    const rings = { x: [], y: [], size: [], color: [] }, line = { x: [], y: [] };
    if (ready) circle(rings, common.east[place], common.north[place], 16, theme.ink);
    const known = common.query_east && Number.isFinite(common.query_east[query]);
    const at = known ? [common.query_east[query], common.query_north[query]]
      : truth >= 0 ? [common.east[truth], common.north[truth]] : null;
    if (at && ready && kind === "wrong") {
      circle(rings, at[0], at[1], 10, theme.truth);
      line.x = [common.east[place], at[0]];
      line.y = [common.north[place], at[1]];
    }
    fill(fig.plan, "ring", rings);
    fill(fig.plan, "error", line);
  }
}

function choose(j) {
  query = clamp(Math.round(j), 0, m - 1);
  const range = fig.matrix.x_range, width = range.end - range.start;
  if (query < range.start || query > range.end) {
    const start = clamp(query - width / 2, -0.5, m - 0.5 - width);
    range.setv({ start, end: start + width });
  }
  drawQuery();
}

function pick(k) {
  chosen = k;
  methods[k].on = true;
  document.querySelectorAll("#explorer-methods input[type=radio]")[k].checked = true;
  document.querySelectorAll("#explorer-methods input[type=checkbox]")[k].checked = true;
  drawMethod();
}

function drawMethod() {
  drawMarks();
  drawStrip();
  drawCurves();
  drawThreshold();
  drawQuery();
}

// The next query for which the chosen method is wrong; without a truth, that is not trusted.
function next(step) {
  const method = methods[chosen];
  for (let k = 1; k <= m; k++) {
    const j = (query + step * k + m * k) % m;
    const bad = data.judged
      ? has(method, j, JUDGED) && !has(method, j, RIGHT) && taken(method, j)
      : has(method, j, READY) && !common.trusted[j];
    if (bad) { pinned = true; choose(j); return; }
  }
}

// Where to begin: at the wrong match of the best score, if one is wrong.
function worst() {
  const method = methods[chosen];
  let found = m >> 1, least = Infinity;
  for (let j = 0; j < m; j++) {
    const wrong = has(method, j, JUDGED) && !has(method, j, RIGHT) && taken(method, j);
    if (wrong && method.score[j] < least) { least = method.score[j]; found = j; }
  }
  return found;
}

function zoom(factor) {
  const ranges = [[fig.matrix.x_range, query, m],
                  [fig.matrix.y_range, methods[chosen].place[query], data.places]];
  for (const [range, at, size] of ranges) {
    const width = clamp((range.end - range.start) * factor, Math.min(8, size), size);
    const start = clamp(factor > 1 && width >= size ? -0.5 : at - width / 2, -0.5, size - 0.5 - width);
    range.setv({ start, end: start + width });
  }
}

function cell(x, y) {
  const j = Math.round(x), i = Math.round(y);
  if (j < 0 || j >= m || i < 0 || i >= data.places) return;
  const [down, across] = data.block;
  const values = part(fig.matrix, "tones").data_source.data.image[0];
  const level = values[Math.floor(i / down) * data.columns + Math.floor(j / across)];
  $("cell").textContent = `query ${j}, place ${placed(i)}: distance ${digits(data.low + data.step * level)}`;
}

function paint() {
  const given = root.dataset.theme;
  const night = given ? given === "dark" : dark.matches;
  theme = data.themes[night ? 1 : 0];
  for (const each of Object.values(fig)) {
    for (const axis of [...each.below, ...each.left]) {
      axis.setv({ axis_line_color: theme.muted, major_tick_line_color: theme.muted,
                  major_label_text_color: theme.muted, axis_label_text_color: theme.muted });
    }
  }
  const line = (figure, name, color) => { part(figure, name).glyph.line_color = { value: color }; };
  part(fig.matrix, "tones").glyph.color_mapper.palette = theme.tones;
  if (data.judged) line(fig.matrix, "truth", theme.truth);
  if (part(fig.matrix, "breaks")) line(fig.matrix, "breaks", theme.ink);
  line(fig.profile, "distances", theme.ink);
  line(fig.strip, "middles", theme.grid);
  part(fig.strip, "names").glyph.text_color = { value: theme.ink };
  part(fig.matrix, "here").line_color = theme.ink;
  part(fig.strip, "here").line_color = theme.ink;
  part(fig.profile, "true").setv({ line_color: theme.truth, line_dash: [4, 3] });
  if (fig.curve) {
    line(fig.curve, "point", theme.ink);
    part(fig.curve, "point").glyph.fill_color = { value: theme.paper };
  }
  if (fig.plan) {
    line(fig.plan, "road", theme.muted);
    line(fig.plan, "error", theme.ink);
  }
  document.querySelectorAll("#explorer-methods svg line").forEach((each, k) => {
    const own = theme.lines[k];
    each.setAttribute("stroke", own.color);
    each.setAttribute("stroke-width", own.width);
    each.setAttribute("stroke-dasharray", own.dash.join(" "));
  });
  drawMethod();
}

function keys(event) {
  const big = event.shiftKey ? 10 : 1;
  const to = { ArrowLeft: query - big, ArrowRight: query + big, ArrowUp: query + 10,
               ArrowDown: query - 10, Home: 0, End: m - 1 }[event.key];
  if (to !== undefined) { pinned = true; choose(to); }
  else if (event.key === "+" || event.key === "=") zoom(0.5);
  else if (event.key === "-") zoom(2);
  else if (event.key === "0") zoom(Infinity);
  else if (event.key === "Escape") pinned = false;
  else if (event.key === "n" || event.key === "p") next(event.key === "n" ? 1 : -1);
  else return;
  // For those who hear the page: what a pointer shows is not read aloud.
  $("said").textContent = $("query").getAttribute("aria-valuetext");
  event.preventDefault();
}

// The query whose match lies nearest to a point of the plan; null if none is near.
function beside(x, y) {
  const { place } = methods[chosen], seen = fig.plan.x_range;
  let best = null, least = (seen.end - seen.start) / 20;
  for (let j = 0; j < m; j++) {
    const off = Math.hypot(common.east[place[j]] - x, common.north[place[j]] - y);
    if (off < least) { least = off; best = j; }
  }
  return best;
}

function listen() {
  const touch = matchMedia("(pointer: coarse)").matches;
  if (innerWidth < 860) fig.matrix.height = 330;
  for (const name of ["matrix", "strip"]) {
    const figure = fig[name];
    // A finger scrolls the page; the buttons zoom.
    if (touch) for (const tool of figure.toolbar.tools) tool.active = false;
    figure.on_event("mousemove", (event) => {
      if (touch) return;
      if (name === "matrix") cell(event.x, event.y);
      if (!pinned) choose(event.x);
    });
    figure.on_event("tap", (event) => {
      const j = clamp(Math.round(event.x), 0, m - 1);
      pinned = !(pinned && j === query) && !touch;
      if (name === "matrix") cell(event.x, event.y);
      choose(j);
    });
    $(`figure-${name}`).addEventListener("keydown", keys);
  }
  if (fig.plan) {
    fig.plan.on_event("tap", ({ x, y }) => {
      const j = beside(x, y);
      if (j !== null) { pinned = !(pinned && j === query) && !touch; choose(j); }
    });
    fig.plan.on_event("mousemove", ({ x, y }) => {
      const j = touch || pinned ? null : beside(x, y);
      if (j !== null) choose(j);
    });
    if (touch) for (const tool of fig.plan.toolbar.tools) tool.active = false;
  }
  for (const name of ["profile", "curve"]) {
    for (const tool of fig[name]?.toolbar.tools ?? []) tool.active = false;
  }
  // Both figures show the same queries.
  const link = (from, to) => from.change.connect(() => {
    if (from.start !== to.start || from.end !== to.end) {
      to.setv({ start: from.start, end: from.end });
    }
    const labels = part(fig.strip, "names").data_source;
    labels.data = { ...labels.data, x: labels.data.y.map(() => fig.strip.x_range.start) };
  });
  link(fig.matrix.x_range, fig.strip.x_range);
  link(fig.strip.x_range, fig.matrix.x_range);
  $("query").addEventListener("input", (event) => { pinned = true; choose(+event.target.value); });
  $("threshold").addEventListener("input", (event) => {
    methods[chosen].at = +event.target.value;
    drawMarks();
    drawStrip();
    drawThreshold();
    drawQuery();
  });
  $("before").addEventListener("click", () => next(-1));
  $("after").addEventListener("click", () => next(1));
  $("nearer").addEventListener("click", () => zoom(0.5));
  $("further").addEventListener("click", () => zoom(2));
  $("whole").addEventListener("click", () => zoom(Infinity));
  document.querySelectorAll("#explorer-methods tbody tr").forEach((row, k) => {
    row.querySelector("input[type=radio]").addEventListener("change", () => pick(k));
    row.querySelector("input[type=checkbox]").addEventListener("change", (event) => {
      methods[k].on = event.target.checked;
      if (k === chosen && !methods[k].on) event.target.checked = methods[k].on = true;
      drawStrip();
      drawCurves();
      drawThreshold();
    });
  });
  document.querySelectorAll("[data-query]").forEach((button) => {
    button.addEventListener("click", () => {
      const k = methods.findIndex((method) => method.name === button.dataset.method);
      if (k >= 0) pick(k);
      pinned = true;
      choose(+button.dataset.query);
      document.getElementById("explorer").scrollIntoView({ block: "start" });
    });
  });
  dark.addEventListener("change", paint);
  $("theme").addEventListener("click", () => {
    const night = root.dataset.theme ? root.dataset.theme === "dark" : dark.matches;
    root.dataset.theme = night ? "light" : "dark";
    document.querySelectorAll("source[media]").forEach((source) => {
      source.media = night ? "not all" : "all";
    });
    paint();
  });
  let before;
  // Paper is white.
  addEventListener("beforeprint", () => {
    before = root.dataset.theme;
    root.dataset.theme = "light";
    paint();
  });
  addEventListener("afterprint", () => {
    if (before) root.dataset.theme = before; else delete root.dataset.theme;
    paint();
  });
}

async function start() {
  const views = await Promise.all(data.items.map((item) => Bokeh.embed.embed_item(item)));
  fig = {};
  data.figures.forEach((name, k) => { fig[name] = [...views[k]][0].model; });
  const [first, places, ...sources] = fig.matrix.tags.map((source) => source.data);
  common = { ...first, ...places };
  methods = data.methods.map((name, k) => {
    const [own, curve] = [sources[2 * k], sources[2 * k + 1]];
    const method = { name, on: data.on[k], ...own, ...curve };
    if (!method.thresholds) {
      const scores = [];
      for (let j = 0; j < m; j++)
        if (has(method, j, READY) && has(method, j, ACCEPTED)) scores.push(own.score[j]);
      method.thresholds = [...new Set(scores)].sort((a, b) => a - b);
    }
    method.at = method.thresholds.length;
    return method;
  });
  chosen = Math.max(0, data.methods.indexOf(data.chosen));
  if (data.judged) {
    const x = [], y = [];
    for (let j = 0; j < m; j++) {
      const at = common.true_place[j];
      const jump = j && Math.abs(at - common.true_place[j - 1]) > data.jump;
      if (jump) { x.push(j - 0.5); y.push(NaN); }
      x.push(j);
      y.push(at < 0 ? NaN : at);
    }
    fill(fig.matrix, "truth", { x, y });
  }
  listen();
  paint();
  choose(worst());
  document.getElementById("explorer").dataset.ready = "yes";
}

if (window.Bokeh) start();
})();
