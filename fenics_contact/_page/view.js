// The view of the bodies, drawn by plotly.

function plane() {
  const axis = Number($("axis").value);
  if (axis < 0) return null;
  const [low, high] = page.box;
  // Never through a layer of nodes, where faces of cells would count as cut or not by rounding.
  const length = high[axis] - low[axis],
    name = low[axis] + length * (Number($("place").value) / 200);
  return {
    axis,
    name,
    place: name + 1.7e-5 * length,
    side: Math.sign(direction()[axis]) * ($("other").checked ? -1 : 1),
  };
}

function surfaces() {
  const at = plane(),
    contact = field().contact,
    parts = { plain: new Surface(), outline: new Surface() };
  Object.assign(parts, {
    coloured: new Surface(),
    cut: new Surface(),
    mesh: new Surface(),
    lines: new Surface(),
    points: [[], [], []],
  });
  for (const body of visible()) {
    const [values, cellwise] = valuesOf(body),
      marks = status(body);
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
const LIGHT = {
  ambient: 0.8,
  diffuse: 0.25,
  specular: 0,
  fresnel: 0,
  facenormalsepsilon: 0,
  vertexnormalsepsilon: 0,
};
const EVEN = { ...LIGHT, ambient: 1, diffuse: 0 };

function mesh(surface, more) {
  const { x, y, z, i, j, k } = surface;
  return {
    type: "mesh3d",
    x,
    y,
    z,
    i,
    j,
    k,
    flatshading: true,
    lighting: page.plane ? EVEN : LIGHT,
    lightposition: { x: -3e4, y: -1e5, z: 1e5 },
    ...more,
  };
}

function lines(surface, line, more = {}) {
  const lift = page.plane ? page.lift : 0;
  const z = lift ? surface.z.map((height) => (height === null ? null : height + lift)) : surface.z;
  return {
    type: "scatter3d",
    mode: "lines",
    x: surface.x,
    y: surface.y,
    z,
    line,
    hoverinfo: "skip",
    showlegend: false,
    ...more,
  };
}

function traces() {
  const parts = surfaces(),
    { label, unit, contact } = field(),
    colours = page.colours;
  const place = `x %{x:.4g}, y %{y:.4g}, z %{z:.4g} ${page.length}`;
  const words = `${label}: %{intensity:.4g} ${unit}<br>${place}<extra></extra>`;
  const coloured = (surface, lighting) =>
    mesh(surface, {
      lighting,
      intensity: surface.values,
      intensitymode: parts.cellwise ? "cell" : "vertex",
      coloraxis: "coloraxis",
      hovertemplate: words,
    });
  const made = [
    mesh(parts.plain, { color: "#d5d9dc", opacity: contact && !page.plane ? 0.15 : 1, hoverinfo: "skip" }),
    coloured(parts.coloured, page.plane ? EVEN : LIGHT),
    coloured(parts.cut, EVEN),
    lines(parts.outline, { color: colours.line, width: 2 }),
    lines(parts.mesh, { color: colours.line, width: 1 }),
  ];
  if (parts.lines.x.length) {
    made.push(
      lines(
        parts.lines,
        { color: parts.lines.values, coloraxis: "coloraxis", width: 12 },
        { hoverinfo: "x+y" },
      ),
    );
  }
  parts.points.forEach((points, mark) => {
    if (!points.length) return;
    const [x, y, z] = [0, 1, 2].map((axis) =>
      points.map((point) => point[axis] + (axis === 2 && page.plane ? 2 * page.lift : 0)),
    );
    const name = `${page.status[mark]} (${points.length})`;
    made.push({
      type: "scatter3d",
      mode: "markers",
      x,
      y,
      z,
      name,
      showlegend: true,
      hoverinfo: "name",
      marker: { size: mark ? 5 : 3, color: colours.status[mark] },
    });
  });
  page.obstacles.forEach(({ lines: each, type }) =>
    each.forEach((points) => {
      const [x, y, z] = [0, 1, 2].map((axis) => points.map((point) => point[axis]));
      made.push({
        type: "scatter3d",
        mode: "lines",
        x,
        y,
        z,
        line: { color: colours.obstacle, width: 4 },
        name: type,
        hoverinfo: "name",
        showlegend: false,
      });
    }),
  );
  return made;
}

function layout() {
  const [low, high] = contactBox() || box(shown.scale),
    narrow = $("view").clientWidth < 560,
    { label, unit, colours, contact } = field();
  const size = high.map((x, n) => Math.max(x - low[n], 1e-9)),
    diagonal = Math.hypot(...size);
  const on = $("axes").checked;
  const axes = ["x", "y", "z"].map((name, n) => ({
    title: { text: page.length ? `${name} (${page.length})` : name },
    visible: on && !(page.plane && n === 2),
    showbackground: false,
    showspikes: false,
    nticks: Math.max(2, Math.round(((narrow ? 6 : 9) * size[n]) / Math.max(...size))),
    ...(page.plane ? { tickangle: 0 } : {}),
    gridcolor: "#e6e6e6",
    range: [low[n] - 0.02 * diagonal, high[n] + 0.02 * diagonal],
  }));
  const spans = size.map((length) => length + 0.04 * diagonal);
  const ratio = spans.map(
    (length) => (page.plane ? flat(spans, narrow) : 1.7 / Math.hypot(...spans)) * length,
  );
  const scene = {
    xaxis: axes[0],
    yaxis: axes[1],
    zaxis: axes[2],
    aspectmode: "manual",
    aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] },
    camera: camera(ratio, narrow),
  };
  if (page.plane) scene.dragmode = "pan";
  const title = { text: unit ? `${label} (${unit})` : label, side: narrow ? "top" : "right" };
  const bar = narrow
    ? { orientation: "h", y: 0, yanchor: "top", len: 0.94, thickness: 14 }
    : { thickness: 18, len: 0.85 };
  return {
    scene,
    uirevision: "same",
    hovermode: "closest",
    paper_bgcolor: "#ffffff",
    margin: { l: 0, r: 0, t: 0, b: narrow ? 70 : 0 },
    legend: { x: 0, y: 1, bgcolor: "#ffffffcc", itemsizing: "constant" },
    coloraxis: {
      cmin: Number($("low").value),
      cmax: Number($("high").value),
      showscale: colours !== "status",
      colorscale: page.colours[contact && colours === "size" ? "contact" : colours] || page.colours.size,
      colorbar: {
        ...bar,
        title,
        exponentformat: "power",
        tickfont: { size: narrow ? 11 : 13 },
        nticks: narrow ? 5 : 9,
      },
    },
  };
}

// From where one looks at first, and so what a section takes away: what is nearer.
function direction() {
  const size = page.box[1].map((x, n) => x - page.box[0][n]);
  return size[1] > size[0] ? [1, -0.3, 0.7] : [-0.3, -1, 0.7];
}

// Width and height of the view in pixels without the colour bar, and without room for the names of axes.
function room(narrow) {
  const wide = $("view").clientWidth - (narrow ? 0 : 130),
    high = $("view").clientHeight - (narrow ? 70 : 0);
  // In the plane names lie beside the ends of axes, on both sides as the view is centred.
  const names = page.plane ? (narrow ? 20 : 60) : 0;
  return {
    wide,
    high,
    free: [wide - (narrow ? 130 : 150) - names, high - (narrow ? 100 : 130) - names],
  };
}

// Length in the scene of a unit of length, so that a plane scene fills the view, 2.17 high in this projection.
function flat([width, height], narrow) {
  const { high, free } = room(narrow);
  return Math.min(free[0] / width, free[1] / height) * (2.17 / high);
}

function camera(sides, narrow) {
  if (page.plane)
    return { eye: { x: 0, y: 0, z: 2 }, up: { x: 0, y: 1, z: 0 }, projection: { type: "orthographic" } };
  const to = unit(direction()),
    right = unit([-to[1], to[0], 0]),
    up = cross(to, right);
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((n) =>
    sides.map((side, axis) => (n & (1 << axis) ? side / 2 : -side / 2)),
  );
  const { high, free } = room(narrow);
  const tangents = free.map((pixels) => (Math.tan(Math.PI / 8) * pixels) / high);
  let far = 0.5;
  const fits = (corner) => {
    const depth = far - dot(corner, to);
    return (
      Math.abs(dot(corner, right)) < tangents[0] * depth && Math.abs(dot(corner, up)) < tangents[1] * depth
    );
  };
  while (!corners.every(fits)) far *= 1.05;
  const [x, y, z] = to.map((part) => far * part);
  return { eye: { x, y, z }, up: { x: 0, y: 0, z: 1 }, projection: { type: "perspective" } };
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((part) => part / Math.hypot(...a));

const written = (x) => Number(x.toPrecision(4)).toString().replace("-", "\u2212");

function say() {
  const { label, unit, extremes } = field(),
    found = extremes[shown.step],
    step = page.steps[shown.step],
    at = plane();
  const words = [found ? `${label}: ${written(found[0])} to ${written(found[1])} ${unit}`.trim() : label];
  if (page.steps.length > 1) words.push(`step ${shown.step + 1} of ${page.steps.length}, ${step.label}`);
  words.push(`displacement × ${written(shown.scale)}`);
  if (at)
    words.push(`section of the undeformed bodies at ${"xyz"[at.axis]} = ${written(at.name)} ${page.length}`);
  if (field().place === "on_cells") words.push("one value per cell");
  if (found && (found[0] < Number($("low").value) || found[1] > Number($("high").value)))
    words.push("values beyond the bar have the colours of its ends");
  if (field().contact) words.push("on slave surfaces");
  const missing = page.obstacles.filter(({ lines: each }) => !each.length).map(({ type }) => type);
  if (missing.length) words.push(`not drawn: ${missing.join(", ")}`);
  $("caption").textContent = `${words.join("; ")}.`;
  $("step-name").textContent = `${shown.step + 1} of ${page.steps.length}: ${step.label}`;
  $("scale-name").textContent = written(shown.scale);
  $("colours").hidden = field().colours === "status";
  $("place").disabled = $("other").disabled = !at;
  $("place-name").textContent = at ? `${written(at.name)} ${page.length}` : "";
}

function draw() {
  if (waiting) return;
  waiting = true;
  drawn = drawn
    .then(() => new Promise((done) => setTimeout(done, 0)))
    .then(async () => {
      waiting = false;
      say();
      await Plotly.react($("view"), traces(), layout(), {
        responsive: true,
        displaylogo: false,
        scrollZoom: true,
        modeBarButtons: [
          ["toImage", "zoom3d", "pan3d", ...(page.plane ? [] : ["orbitRotation"]), "resetCameraDefault3d"],
        ],
      });
      $("view").dataset.drawn = Number($("view").dataset.drawn || 0) + 1;
    });
  drawn.catch((error) => trouble({ message: error.message }));
}
