"use strict";
const figures = JSON.parse(document.getElementById("figures").textContent);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const narrow = window.matchMedia("(max-width: 600px)");

function themed(layout) {
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink").trim();
  const rule = style.getPropertyValue("--rule").trim();
  const soft = style.getPropertyValue("--soft").trim();
  const axis = { gridcolor: rule, zerolinecolor: rule, linecolor: rule, automargin: true };
  return {
    ...layout,
    xaxis: { ...axis, ...layout.xaxis },
    yaxis: { ...axis, ...layout.yaxis },
    font: { family: "system-ui, sans-serif", color: ink, size: narrow.matches ? 11 : 13 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 50, r: 10, t: 30, b: 45 },
    legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0, itemsizing: "constant" },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: soft, activecolor: ink },
    hovermode: "closest",
    dragmode: narrow.matches ? false : "zoom",
  };
}

// An explicit list: the default one holds buttons that talk to a server.
const buttons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
const bar = narrow.matches ? false : "hover";
const options = { responsive: true, displaylogo: false, displayModeBar: bar, modeBarButtons: buttons };

function draw(element) {
  const figure = figures[Number(element.dataset.figure)];
  return Plotly.react(element, figure.traces, themed(figure.layout), options);
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
