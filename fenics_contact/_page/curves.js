// Curves below the view.

function curve(id, x, y, words) {
  const traces = Object.entries(y).map(([name, values]) => ({
    x,
    y: values.map((value) => value || null),
    name,
    mode: "lines+markers",
    marker: { size: 5 },
  }));
  return Plotly.newPlot(
    id,
    traces,
    {
      margin: { l: 70, r: 10, t: 10, b: 80 },
      legend: { orientation: "h", y: -0.28 },
      xaxis: { title: { text: words.x }, type: words.logx ? "log" : "linear" },
      yaxis: {
        title: { text: words.y },
        type: words.log ? "log" : "linear",
        exponentformat: "power",
        dtick: words.log ? words.step : undefined,
      },
      shapes: words.line
        ? [
            {
              type: "line",
              xref: "paper",
              x0: 0,
              x1: 1,
              y0: words.line,
              y1: words.line,
              line: { dash: "dash", width: 1 },
            },
          ]
        : [],
      annotations: words.line
        ? [
            {
              xref: "paper",
              x: 0,
              xanchor: "left",
              y: Math.log10(words.line),
              yanchor: "bottom",
              text: words.limit,
              showarrow: false,
            },
          ]
        : [],
    },
    { responsive: true, displaylogo: false, displayModeBar: false },
  );
}

async function curves() {
  const { residuals, evaluations, levels, tolerance } = page.history,
    steps = residuals.products || [];
  $("curves").hidden = !steps.length && !evaluations.value && !levels.error;
  $("by-unknowns").hidden = $("by-seconds").hidden = !levels.error;
  $("history").hidden = !steps.length;
  $("objective").hidden = !evaluations.value;
  for (const [id, x] of levels.error ? [["by-unknowns", "unknowns"], ["by-seconds", "seconds"]] : [])
    await curve(
      id,
      levels[x],
      { error: levels.error },
      {
        x: x === "seconds" ? "seconds of all meshes up to this one" : "unknowns of the mesh",
        y: "estimated relative error",
        log: true,
        logx: true,
        line: levels.wanted,
        limit: "asked for",
        step: 1,
      },
    );
  if (steps.length) {
    const { natural, gluing, coarse } = residuals,
      limit = typeof tolerance === "number" ? tolerance : null;
    const all = [...natural, ...gluing, ...coarse].filter((x) => x > 0).map(Math.log10);
    const step = Math.max(1, Math.ceil((Math.max(...all) - Math.min(...all)) / 8));
    await curve(
      "history",
      steps,
      { "natural (contact)": natural, gluing, "coarse (equilibrium)": coarse },
      {
        x: page.steps.length > 1 ? "products with F in the last step" : "products with F",
        y: "relative residual",
        log: true,
        line: limit,
        limit: "tolerance",
        step,
      },
    );
  }
  if (evaluations.value) {
    const { evaluations: x, value, best } = evaluations;
    await curve(
      "objective",
      x,
      { objective: value, best },
      { x: "evaluation", y: "objective", log: false, line: null },
    );
  }
}
