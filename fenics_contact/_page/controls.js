// What one can choose, and the start of everything.

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
  const middle = Math.round(Math.log10(page.scale)),
    all = [0];
  for (let power = Math.min(0, middle - 1); power <= middle + 2; power++)
    all.push(...[1, 2, 5].map((x) => Number((x * 10 ** power).toPrecision(1))));
  return all;
}

function prepare() {
  page.box = box(null);
  page.lift = 1e-3 * Math.max(...page.box[1].map((x, n) => x - page.box[0][n]));
  $("title").textContent = page.title;
  for (const part of new Set(page.fields.map((each) => each.part))) {
    const group = Object.assign(document.createElement("optgroup"), { label: part });
    page.fields.forEach((each, n) => each.part === part && group.append(new Option(each.label, n)));
    $("field").append(group);
  }
  $("field").value = shown.field = page.first;
  setRange(field().range);
  choose("field", ({ value }) => {
    shown.field = Number(value);
    setRange(field().range);
  });
  $("steps").hidden = page.steps.length < 2;
  $("step").max = page.steps.length - 1;
  $("step").value = shown.step = page.steps.length - 1;
  choose("step", ({ value }) => {
    shown.step = Number(value);
  });
  const factors = scales();
  $("scale").max = factors.length - 1;
  $("scale").value = factors.indexOf(page.scale);
  choose("scale", ({ value }) => {
    shown.scale = factors[Number(value)];
  });
  $("section").hidden = page.plane;
  $("near").parentElement.hidden = !page.steps.some((step) =>
    step.bodies.some((body) => body && status(body) && status(body).some((mark) => mark > 0)),
  );
  for (const id of ["low", "high", "axis", "place", "other", "near", "mesh", "axes"]) choose(id, () => {});
  $("whole").addEventListener("click", () => {
    setRange(field().extremes[shown.step] || field().range);
    draw();
  });
  page.bodies.forEach((name, n) => {
    const label = $("bodies").appendChild(document.createElement("label"));
    const box = label.appendChild(document.createElement("input"));
    Object.assign(box, {
      type: "checkbox",
      checked: true,
      oninput: () => {
        shown.bodies[n] = box.checked;
        draw();
      },
    });
    label.append(` ${name}`);
  });
  if (page.fields.length === 0) throw new Error("the result has no fields");
}

(async () => {
  connect(await unpacked());
  prepare();
  draw();
  await drawn;
  await curves();
  window.addEventListener("resize", draw);
})();
