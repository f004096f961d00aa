"use strict";
const figures = JSON.parse(document.getElementById("figures").textContent);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const narrow = window.matchMedia("(max-width: 600px)");

// Where the screen is narrow the buttons are always there, in a row of their own above the legend.
const BAR_PX = 40;
const LEGEND_ROW_PX = 20;
const LEGEND_MARK_PX = 40;
const LETTER_PX = 6.2;
const BESIDE_PX = 62;

// Room above a plot on a narrow screen: the buttons, and as many rows of the legend as its entries need.  These stand in
// columns as wide as the widest, but where traces are grouped one after the other.
function room(figure, width) {
  if (!narrow.matches) return 0;
  const entries = figure.traces.filter((trace) => trace.name && trace.showlegend !== false);
  const wide = entries.map((entry) => LEGEND_MARK_PX + LETTER_PX * entry.name.length);
  const grouped = figure.traces.some((trace) => trace.legendgroup);
  let [rows, left] = [1, width - BESIDE_PX];
  for (const own of wide) {
    const needed = grouped ? own : Math.max(...wide);
    if (needed > left) [rows, left] = [rows + 1, width - BESIDE_PX];
    left -= needed;
  }
  return BAR_PX + LEGEND_ROW_PX * (rows - 1);
}

// Names of corridor sections that would be written over each other on a narrow screen are left out.
function spaced(names) {
  if (!narrow.matches || !names || names.length < 2) return names;
  const apart = 0.3 * (names[names.length - 1].x - names[0].x);
  let last = -Infinity;
  return names.filter((name) => name.x - last >= apart && ((last = name.x), true));
}

function themed(layout, extra) {
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink").trim();
  const rule = style.getPropertyValue("--rule").trim();
  const soft = style.getPropertyValue("--soft").trim();
  const axis = { gridcolor: rule, zerolinecolor: rule, linecolor: rule, automargin: true };
  return {
    ...layout,
    annotations: spaced(layout.annotations),
    xaxis: { ...axis, ...layout.xaxis },
    yaxis: { ...axis, ...layout.yaxis },
    font: { family: "system-ui, sans-serif", color: ink, size: narrow.matches ? 11 : 13 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 50, r: 10, t: 30 + extra, b: 45 },
    legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0, itemsizing: "constant" },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: soft, activecolor: ink },
    hovermode: "closest",
    dragmode: narrow.matches ? false : "zoom",
  };
}

// An explicit list: the default one holds buttons that talk to a server.
const buttons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
const bar = narrow.matches ? true : "hover";
const options = { responsive: true, displaylogo: false, displayModeBar: bar, modeBarButtons: buttons };

// Plots over time share one range: a zoom in one shows the same seconds in all.
let shared = null;

function draw(element) {
  const figure = figures[Number(element.dataset.figure)];
  const extra = room(figure, element.clientWidth);
  const layout = themed(figure.layout, extra);
  layout.height += extra;
  element.style.height = `${layout.height}px`;
  if (figure.time && shared) layout.xaxis = { ...layout.xaxis, range: [...shared] };
  const first = !element.data;
  const drawn = Plotly.react(element, figure.traces, layout, options);
  if (first && figure.time) element.on("plotly_relayout", (change) => share(element, change));
  return drawn;
}

function share(source, change) {
  if (!Object.keys(change).some((key) => key.startsWith("xaxis."))) return;
  const range = source.layout.xaxis.range.map(Number);
  if (shared && range[0] === shared[0] && range[1] === shared[1]) return;
  shared = range;
  for (const element of plots) {
    if (element !== source && element.data && figures[Number(element.dataset.figure)].time) {
      Plotly.relayout(element, { "xaxis.range": [...range] });
    }
  }
}

const plots = Array.from(document.querySelectorAll(".plot"));
const watcher = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (entry.isIntersecting) {
      watcher.unobserve(entry.target);
      draw(entry.target);
    }
  }
}, { rootMargin: "600px" });
plots.forEach((element) => watcher.observe(element));

dark.addEventListener("change", () => plots.filter((element) => element.data).forEach(draw));
window.addEventListener("beforeprint", () => plots.forEach(draw));

for (const button of document.querySelectorAll("[data-copy]")) {
  button.addEventListener("click", () => {
    const range = document.createRange();
    range.selectNodeContents(document.getElementById(button.dataset.copy));
    const selection = window.getSelection();
    selection.removeAllRanges();
    selection.addRange(range);
    document.execCommand("copy");
  });
}
