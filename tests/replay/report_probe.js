// Uses the page as a person would and tells the page around it what happened.
const use = async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const until = async (met) => { for (let k = 0; k < 100 && !met(); k++) await wait(100); };
  const coloursOf = (picture) => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [800, 200];
    const pen = canvas.getContext("2d");
    pen.imageSmoothingEnabled = false;
    pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
    const seen = new Map();
    for (const word of new Uint32Array(pen.getImageData(0, 0, canvas.width, canvas.height).data.buffer)) {
      if (word >>> 24 === 255) seen.set(word, (seen.get(word) || 0) + 1);
    }
    return Array.from(seen.values()).filter((count) => count > 100).length;
  };
  const plots = Array.from(document.querySelectorAll(".plot"));
  const mouse = (target, kind, x, y) =>
    target.dispatchEvent(new MouseEvent(kind, { bubbles: true, view: window, clientX: x, clientY: y, button: 0 }));
  await until(() => plots.every((plot) => plot.querySelector(".nsewdrag")));
  const found = { drawn: plots.filter((plot) => plot.data).length, plots: plots.length };
  found.overflow = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  found.width = window.innerWidth;
  found.touching = plots.filter((plot) => {
    const [bar, legend] = [".modebar-group", ".legend .bg"].map((part) => plot.querySelector(part));
    if (!bar || !legend) return false;
    const [a, b] = [bar.getBoundingClientRect(), legend.getBoundingClientRect()];
    return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  }).map((plot) => plot.layout.yaxis.title.text);
  found.paper = getComputedStyle(document.body).backgroundColor;
  found.ink = plots[0].layout.font.color;
  const time = plots.filter((plot) => plot.layout.xaxis.title.text.startsWith("time"));
  found.before = time.map((plot) => plot.layout.xaxis.range.map(Number));
  const heading = Array.from(document.querySelectorAll("h2")).find((h) => h.textContent === "Supervisor");
  const strip = heading.parentElement.querySelector(".plot");
  found.supervised = Array.from(strip.querySelectorAll(".ytick text")).map((e) => e.textContent.trim());
  await until(() => coloursOf(strip.querySelector(".heatmaplayer image")) > 0);
  found.colours = coloursOf(strip.querySelector(".heatmaplayer image"));
  if (plots[0].layout.dragmode !== "zoom") {
    plots[0].querySelector('[data-attr="dragmode"][data-val="zoom"]').click();
    await until(() => plots[0].layout.dragmode === "zoom");
  }
  const area = plots[0].querySelector(".nsewdrag");
  const box = area.getBoundingClientRect();
  const y = box.top + 0.5 * box.height;
  mouse(area, "mousedown", box.left + 0.25 * box.width, y);
  mouse(document, "mousemove", box.left + 0.5 * box.width, y);
  mouse(document, "mouseup", box.left + 0.5 * box.width, y);
  await wait(1500);
  found.after = time.map((plot) => plot.layout.xaxis.range.map(Number));
  const entry = plots[0].querySelector(".legendtoggle");
  mouse(entry, "mousedown", 0, 0);
  mouse(entry, "mouseup", 0, 0);
  await wait(1500);
  found.hidden = plots[0].data.filter((trace) => trace.visible === "legendonly").length;
  document.querySelector(".card").click();
  const tip = document.getElementById("tip").getBoundingClientRect();
  found.tip = document.getElementById("tip").textContent;
  found.tipInside = tip.left >= 0 && tip.right <= window.innerWidth && tip.width > 0;
  found.untold = Array.from(document.querySelectorAll(".card, thead th")).filter((e) => !e.dataset.tip && e.textContent).length;
  window.parent.postMessage(JSON.stringify(found), "*");
};
use().catch((error) => window.parent.postMessage(JSON.stringify({ error: String(error) }), "*"));
