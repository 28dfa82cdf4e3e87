const page = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const STATUS = ["open", "stick", "slip"];
const shown = { bodies: page.bodies.map(() => true), field: 0, step: 0, scale: page.scale };
let drawn = Promise.resolve(), waiting = false;

function trouble(event) {
  $("trouble").hidden = false;
  $("trouble").textContent = `Something is not shown: ${event.message || event.reason}`;
}
window.addEventListener("error", trouble);
window.addEventListener("unhandledrejection", trouble);

// ---- what is in the page

async function unpacked() {
  if (!window.DecompressionStream) throw new Error("this page needs a browser of 2023 or later");
  const bytes = Uint8Array.from(atob($("arrays").textContent.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  return page.arrays.map(({ type, start, length, columns }) => ({
    values: new (type === "u4" ? Uint32Array : Float32Array)(buffer, start, length), columns,
  }));
}

// Put arrays in the place of their numbers.
function connect(arrays) {
  const all = (names) => Object.fromEntries(Object.entries(names).map(([name, n]) => [name, arrays[n]]));
  for (const step of page.steps) {
    step.bodies = step.bodies.map((body) => body && {
      ...Object.fromEntries(["points", "triangles", "owner", "edges", "outline", "cells"].map((name) => [name, arrays[body[name]]])),
      nodes: all(body.nodes), on_cells: all(body.on_cells), means: {},
    });
  }
}

const field = () => page.fields[shown.field];
const visible = () => page.steps[shown.step].bodies.filter((body, n) => body && shown.bodies[n]);
const status = (body) => body.nodes.contact_status && body.nodes.contact_status.values;

function component({ values, columns }, number) {
  if (columns === 1) return values;
  const one = new Float32Array(values.length / columns);
  for (let n = 0; n < one.length; n++) {
    one[n] = number < 0 ? Math.hypot(...values.subarray(columns * n, columns * (n + 1))) : values[columns * n + number];
  }
  return one;
}

// Values of the chosen field, and whether they are per cell; null where a body lacks the field.
function valuesOf(body) {
  const { source, place, component: number } = field();
  if (!body[place][source]) return [null, false];
  if (place === "nodes") return [component(body.nodes[source], number), false];
  const values = component(body.on_cells[source], number);
  if (!$("smooth").checked) return [values, true];
  const key = `${source} ${number}`;
  body.means[key] = body.means[key] || meansAtNodes(body, values);
  return [body.means[key], false];
}

// The corners of the box around all steps at the chosen scale, and around the undeformed bodies.
function box(scale) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const widen = (x, axis) => {
    low[axis] = Math.min(low[axis], x);
    high[axis] = Math.max(high[axis], x);
  };
  for (const body of page.steps.flatMap((step) => step.bodies.filter((each) => each))) {
    const points = body.points.values, moves = body.nodes.displacement && body.nodes.displacement.values;
    points.forEach((x, n) => widen(x + (moves && scale ? scale * moves[n] : 0), n % 3));
  }
  if (scale !== null) page.obstacles.forEach(({ lines }) => lines.flat().forEach((point) => point.forEach(widen)));
  return [low, high];
}

// ---- what is drawn

function plane() {
  const axis = Number($("axis").value);
  if (axis < 0) return null;
  const [low, high] = page.box;
  // Never through a layer of nodes, where faces of cells would count as cut or not by rounding.
  const length = high[axis] - low[axis], name = low[axis] + length * (Number($("place").value) / 200);
  return { axis, name, place: name + 1.7e-5 * length, side: Math.sign(direction()[axis]) * ($("other").checked ? -1 : 1) };
}

function surfaces() {
  const at = plane(), contact = field().contact, parts = { plain: new Surface(), outline: new Surface() };
  Object.assign(parts, { coloured: new Surface(), cut: new Surface(), mesh: new Surface(), lines: new Surface(), points: [[], [], []] });
  for (const body of visible()) {
    const [values, cellwise] = valuesOf(body), marks = status(body);
    const shape = new Shape(body, shown.scale, at, values, cellwise);
    const bare = new Shape(body, shown.scale, at, null, false);
    parts.cellwise = parts.cellwise || cellwise;
    if (!contact && values) {
      shape.addSkin(parts.coloured);
      if (at) shape.addCut(parts.cut);
    } else {
      bare.addSkin(parts.plain);
    }
    if (contact && values && marks && field().colours !== "status") {
      if (page.plane) shape.addLines(parts.lines, body.outline.values, marks);
      else shape.addSkin(parts.coloured, marks);
    }
    if (contact && marks && field().colours === "status") addPoints(parts.points, bare, marks);
    bare.addLines(parts.outline, body.outline.values);
    if ($("mesh").checked) bare.addLines(parts.mesh, body.edges.values);
  }
  return parts;
}

function addPoints(points, shape, marks) {
  marks.forEach((mark, n) => {
    if (mark >= 0 && !(shape.distance && shape.distance[n] > 0)) points[mark].push(shape.position(n, n, 0));
  });
}

// Little shade, so that colours are those of the bar, and none on faces of a section.
const LIGHT = { ambient: 0.8, diffuse: 0.25, specular: 0, fresnel: 0, facenormalsepsilon: 0, vertexnormalsepsilon: 0 };
const EVEN = { ...LIGHT, ambient: 1, diffuse: 0 };

function mesh(surface, more) {
  const { x, y, z, i, j, k } = surface;
  return { type: "mesh3d", x, y, z, i, j, k, flatshading: true, lighting: page.plane ? EVEN : LIGHT, lightposition: { x: -3e4, y: -1e5, z: 1e5 }, ...more };
}

function lines(surface, line, more = {}) {
  const lift = page.plane ? page.lift : 0;
  const z = lift ? surface.z.map((height) => (height === null ? null : height + lift)) : surface.z;
  return { type: "scatter3d", mode: "lines", x: surface.x, y: surface.y, z, line, hoverinfo: "skip", showlegend: false, ...more };
}

function traces() {
  const parts = surfaces(), { label, unit, contact } = field(), colours = page.colours;
  const words = `${label}: %{intensity:.4g} ${unit}<br>x %{x:.4g}, y %{y:.4g}, z %{z:.4g} ${page.length}<extra></extra>`;
  const coloured = (surface, lighting) => mesh(surface, {
    lighting, intensity: surface.values, intensitymode: parts.cellwise ? "cell" : "vertex", coloraxis: "coloraxis", hovertemplate: words,
  });
  const made = [
    mesh(parts.plain, { color: "#d5d9dc", opacity: contact && !page.plane ? 0.15 : 1, hoverinfo: "skip" }),
    coloured(parts.coloured, page.plane ? EVEN : LIGHT),
    coloured(parts.cut, EVEN),
    lines(parts.outline, { color: colours.line, width: 2 }),
    lines(parts.mesh, { color: colours.line, width: 1 }),
  ];
  if (parts.lines.x.length) {
    made.push(lines(parts.lines, { color: parts.lines.values, coloraxis: "coloraxis", width: 12 }, { hoverinfo: "x+y" }));
  }
  parts.points.forEach((points, mark) => {
    if (!points.length) return;
    const [x, y, z] = [0, 1, 2].map((axis) => points.map((point) => point[axis] + (axis === 2 && page.plane ? 2 * page.lift : 0)));
    const name = `${page.frictionless && mark === 2 ? "closed" : STATUS[mark]} (${points.length})`;
    made.push({ type: "scatter3d", mode: "markers", x, y, z, name, showlegend: true, hoverinfo: "name", marker: { size: mark ? 5 : 3, color: colours.status[mark] } });
  });
  page.obstacles.forEach(({ lines: each, type }) => each.forEach((points) => {
    const [x, y, z] = [0, 1, 2].map((axis) => points.map((point) => point[axis]));
    made.push({ type: "scatter3d", mode: "lines", x, y, z, line: { color: colours.obstacle, width: 4 }, name: type, hoverinfo: "name", showlegend: false });
  }));
  return made;
}

function layout() {
  const [low, high] = box(shown.scale), narrow = $("view").clientWidth < 560, { label, unit, colours, contact } = field();
  const size = high.map((x, n) => Math.max(x - low[n], 1e-9)), diagonal = Math.hypot(...size);
  const on = $("axes").checked;
  const axes = ["x", "y", "z"].map((name, n) => ({
    title: { text: page.length ? `${name} (${page.length})` : name }, visible: on && !(page.plane && n === 2), showbackground: false,
    showspikes: false, nticks: 6, ...(page.plane ? { tickangle: 0 } : {}), gridcolor: "#e6e6e6", range: [low[n] - 0.02 * diagonal, high[n] + 0.02 * diagonal],
  }));
  const spans = size.map((length) => length + 0.04 * diagonal);
  const ratio = spans.map((length) => (page.plane ? flat(spans, narrow) : 1.7 / diagonal) * length);
  const scene = { xaxis: axes[0], yaxis: axes[1], zaxis: axes[2], aspectmode: "manual", aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] }, camera: camera() };
  if (page.plane) scene.dragmode = "pan";
  const title = { text: unit ? `${label} (${unit})` : label, side: narrow ? "top" : "right" };
  const bar = narrow ? { orientation: "h", y: 0, yanchor: "top", len: 0.94, thickness: 14 } : { thickness: 18, len: 0.85 };
  return {
    scene, uirevision: "same", hovermode: "closest", paper_bgcolor: "#ffffff",
    margin: { l: 0, r: 0, t: 0, b: narrow ? 70 : 0 },
    legend: { x: 0, y: 1, bgcolor: "#ffffffcc", itemsizing: "constant" },
    coloraxis: {
      cmin: Number($("low").value), cmax: Number($("high").value), showscale: colours !== "status",
      colorscale: page.colours[contact && colours === "size" ? "contact" : colours] || page.colours.size,
      colorbar: { ...bar, title, exponentformat: "power", tickfont: { size: narrow ? 11 : 13 }, nticks: narrow ? 5 : 9 },
    },
  };
}

// From where one looks at first, and so what a section takes away: what is nearer.
function direction() {
  const size = page.box[1].map((x, n) => x - page.box[0][n]);
  return size[1] > size[0] ? [1, -0.3, 0.7] : [-0.3, -1, 0.7];
}

// Length in the scene of a unit of length, so that a plane scene fills the view and leaves room for its axes.
function flat([width, height], narrow) {
  const wide = $("view").clientWidth - (narrow ? 130 : 280), high = $("view").clientHeight - (narrow ? 170 : 130);
  return Math.min(wide / width, high / height) * (2.17 / ($("view").clientHeight - (narrow ? 70 : 0)));
}

function camera() {
  if (page.plane) return { eye: { x: 0, y: 0, z: 2 }, up: { x: 0, y: 1, z: 0 }, projection: { type: "orthographic" } };
  const [x, y, z] = direction();
  const far = 1.6 * Math.max(1, (1.3 * $("view").clientHeight) / $("view").clientWidth);
  return { eye: { x: far * x, y: far * y, z: far * z }, up: { x: 0, y: 0, z: 1 }, projection: { type: "perspective" } };
}

const written = (x) => Number(x.toPrecision(4)).toString().replace("-", "\u2212");

function say() {
  const { label, unit, extremes } = field(), found = extremes[shown.step], step = page.steps[shown.step], at = plane();
  const words = [found ? `${label}: ${written(found[0])} to ${written(found[1])} ${unit}`.trim() : label];
  if (page.steps.length > 1) words.push(`step ${shown.step + 1} of ${page.steps.length}, ${step.label}`);
  words.push(`displacement × ${written(shown.scale)}`);
  if (at) words.push(`section of the undeformed bodies at ${"xyz"[at.axis]} = ${written(at.name)} ${page.length}`);
  if (field().place === "on_cells") words.push($("smooth").checked ? "colours are means at the nodes, the range is that of the cells" : "one value per cell");
  if (field().contact) words.push("on slave surfaces");
  const missing = page.obstacles.filter(({ lines: each }) => !each.length).map(({ type }) => type);
  if (missing.length) words.push(`not drawn: ${missing.join(", ")}`);
  $("caption").textContent = `${words.join("; ")}.`;
  $("step-name").textContent = `${shown.step + 1} of ${page.steps.length}: ${step.label}`;
  $("scale-name").textContent = written(shown.scale);
  $("colours").hidden = field().colours === "status";
  $("smooth").parentElement.hidden = field().place !== "on_cells";
  $("place-name").textContent = at ? `${written(at.name)} ${page.length}` : "";
}

function draw() {
  if (waiting) return;
  waiting = true;
  drawn = drawn.then(() => new Promise((done) => setTimeout(done, 0))).then(async () => {
    waiting = false;
    say();
    await Plotly.react($("view"), traces(), layout(), { responsive: true, displaylogo: false, scrollZoom: true, modeBarButtons: [["toImage", "zoom3d", "pan3d", ...(page.plane ? [] : ["orbitRotation"]), "resetCameraDefault3d"]] });
    $("view").dataset.drawn = Number($("view").dataset.drawn || 0) + 1;
  });
  drawn.catch((error) => trouble({ message: error.message }));
}

// ---- what one can choose

function setRange([low, high]) {
  $("low").value = Number(low.toPrecision(4));
  $("high").value = Number((high > low ? high : low + 1).toPrecision(4));
}

function choose(id, set) {
  $(id).addEventListener("input", () => {
    set($(id));
    draw();
  });
}

// 0, and 1, 2, 5 times powers of ten around the scale at the start.
function scales() {
  const middle = Math.round(Math.log10(page.scale)), all = [0];
  for (let power = Math.min(0, middle - 1); power <= middle + 2; power++) all.push(...[1, 2, 5].map((x) => Number((x * 10 ** power).toPrecision(1))));
  return all;
}

function prepare() {
  page.box = box(null);
  page.lift = 1e-3 * Math.max(...page.box[1].map((x, n) => x - page.box[0][n]));
  $("title").textContent = page.title;
  page.fields.forEach(({ label }, n) => $("field").add(new Option(label, n)));
  setRange(field().range);
  choose("field", ({ value }) => {
    shown.field = Number(value);
    setRange(field().range);
  });
  $("steps").hidden = page.steps.length < 2;
  $("step").max = page.steps.length - 1;
  $("step").value = shown.step = page.steps.length - 1;
  choose("step", ({ value }) => { shown.step = Number(value); });
  const factors = scales();
  $("scale").max = factors.length - 1;
  $("scale").value = factors.indexOf(page.scale);
  choose("scale", ({ value }) => { shown.scale = factors[Number(value)]; });
  $("section").hidden = page.plane;
  for (const id of ["low", "high", "smooth", "axis", "place", "other", "mesh", "axes"]) choose(id, () => {});
  $("whole").addEventListener("click", () => {
    setRange(field().extremes[shown.step] || field().range);
    draw();
  });
  page.bodies.forEach((name, n) => {
    const label = $("bodies").appendChild(document.createElement("label"));
    const box = label.appendChild(document.createElement("input"));
    Object.assign(box, { type: "checkbox", checked: true, oninput: () => { shown.bodies[n] = box.checked; draw(); } });
    label.append(` ${name}`);
  });
  if (page.fields.length === 0) throw new Error("the result has no fields");
}

// ---- curves

function curve(id, x, y, words) {
  const traces = Object.entries(y).map(([name, values]) => ({ x, y: values.map((value) => value || null), name, mode: "lines+markers", marker: { size: 5 } }));
  return Plotly.newPlot(id, traces, {
    margin: { l: 70, r: 10, t: 10, b: 80 }, legend: { orientation: "h", y: -0.28 }, xaxis: { title: { text: words.x } },
    yaxis: { title: { text: words.y }, type: words.log ? "log" : "linear", exponentformat: "power", dtick: words.log ? words.step : undefined },
    shapes: words.line ? [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: words.line, y1: words.line, line: { dash: "dash", width: 1 } }] : [],
    annotations: words.line ? [{ xref: "paper", x: 1, xanchor: "right", y: Math.log10(words.line), yanchor: "bottom", text: "tolerance", showarrow: false }] : [],
  }, { responsive: true, displaylogo: false, displayModeBar: false });
}

async function curves() {
  const { residuals, evaluations, tolerance } = page.history, steps = residuals.products || [];
  $("curves").hidden = !steps.length && !evaluations.value;
  $("history").hidden = !steps.length;
  if (steps.length) {
    const { natural, gluing, coarse } = residuals, limit = typeof tolerance === "number" ? tolerance : null;
    const all = [...natural, ...gluing, ...coarse].filter((x) => x > 0).map(Math.log10);
    const step = Math.max(1, Math.ceil((Math.max(...all) - Math.min(...all)) / 8));
    await curve("history", steps, { "natural (contact)": natural, gluing, "coarse (equilibrium)": coarse },
      { x: page.steps.length > 1 ? "products with F, last step" : "products with F", y: "relative residual", log: true, line: limit, step });
  }
  if (evaluations.value) {
    const { evaluations: x, value, best } = evaluations;
    await curve("objective", x, { objective: value, best }, { x: "evaluation", y: "objective", log: false, line: null });
  }
}

(async () => {
  connect(await unpacked());
  prepare();
  draw();
  await drawn;
  await curves();
  window.addEventListener("resize", draw);
})();
