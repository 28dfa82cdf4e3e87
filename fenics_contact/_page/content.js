// What is in the page, and what of it one has chosen.

const page = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const shown = { bodies: page.bodies.map(() => true), field: 0, step: 0, scale: page.scale };
let drawn = Promise.resolve(),
  waiting = false;

function trouble(event) {
  $("trouble").hidden = false;
  $("trouble").textContent = `Something is not shown: ${event.message || event.reason}`;
}
window.addEventListener("error", trouble);
window.addEventListener("unhandledrejection", trouble);

async function unpacked() {
  if (!window.DecompressionStream) throw new Error("this page needs a browser of 2023 or later");
  const bytes = Uint8Array.from(atob($("arrays").textContent.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  return page.arrays.map(({ type, start, length, columns }) => ({
    values: new (type === "u4" ? Uint32Array : Float32Array)(buffer, start, length),
    columns,
  }));
}

// Put arrays in the place of their numbers.
function connect(arrays) {
  const all = (names) => Object.fromEntries(Object.entries(names).map(([name, n]) => [name, arrays[n]]));
  for (const step of page.steps) {
    step.bodies = step.bodies.map(
      (body) =>
        body && {
          ...Object.fromEntries(
            ["points", "triangles", "owner", "edges", "outline", "cells"].map((name) => [
              name,
              arrays[body[name]],
            ]),
          ),
          nodes: all(body.nodes),
          on_cells: all(body.on_cells),
        },
    );
  }
}

const field = () => page.fields[shown.field];
const visible = () => page.steps[shown.step].bodies.filter((body, n) => body && shown.bodies[n]);
const status = (body) => body.nodes.contact_status && body.nodes.contact_status.values;

function component({ values, columns }, number) {
  if (columns === 1) return values;
  const one = new Float32Array(values.length / columns);
  for (let n = 0; n < one.length; n++) {
    one[n] =
      number < 0
        ? Math.hypot(...values.subarray(columns * n, columns * (n + 1)))
        : values[columns * n + number];
  }
  return one;
}

// Values of the chosen field, and whether they are per cell; null where a body lacks the field.
function valuesOf(body) {
  const { source, place, component: number } = field();
  if (!body[place][source]) return [null, false];
  return [component(body[place][source], number), place === "on_cells"];
}

// The corners of the box around all steps at the chosen scale, and around the undeformed bodies.
function box(scale) {
  const low = [Infinity, Infinity, Infinity],
    high = [-Infinity, -Infinity, -Infinity];
  const widen = (x, axis) => {
    low[axis] = Math.min(low[axis], x);
    high[axis] = Math.max(high[axis], x);
  };
  for (const body of page.steps.flatMap((step) => step.bodies.filter((each) => each))) {
    const points = body.points.values,
      moves = body.nodes.displacement && body.nodes.displacement.values;
    points.forEach((x, n) => widen(x + (moves && scale ? scale * moves[n] : 0), n % 3));
  }
  if (scale !== null)
    page.obstacles.forEach(({ lines }) => lines.flat().forEach((point) => point.forEach(widen)));
  return [low, high];
}

// The box around the closed contact points of this step, three times as large; null if there are none.
function contactBox() {
  const points = visible()
    .filter(status)
    .flatMap((body) => {
      const shape = new Shape(body, shown.scale, null, null, false);
      return Array.from(status(body).keys())
        .filter((n) => status(body)[n] > 0)
        .map((n) => shape.position(n, n, 0));
    });
  if (!$("near").checked || !points.length) return null;
  const ends = [0, 1, 2].map((axis) =>
    points
      .map((point) => point[axis])
      .reduce(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]),
  );
  const reach = Math.max(page.lift, ...ends.map(([a, b]) => b - a)),
    [low, high] = box(shown.scale);
  return [
    ends.map(([a], n) => Math.max(low[n], a - reach)),
    ends.map(([, b], n) => Math.min(high[n], b + reach)),
  ];
}
