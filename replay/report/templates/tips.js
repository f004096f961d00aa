// Explanations: title attributes where there is no script; with it they also show on a tap and on keyboard focus.
const tip = document.createElement("div");
tip.id = "tip";
tip.hidden = true;
tip.setAttribute("role", "tooltip");
document.body.append(tip);

function showTip(element) {
  tip.textContent = element.dataset.tip;
  tip.hidden = false;
  const at = element.getBoundingClientRect();
  const room = document.documentElement.clientWidth;
  const left = Math.max(8, Math.min(at.left, room - tip.offsetWidth - 8));
  const below = at.bottom + 6;
  const fits = below + tip.offsetHeight < window.innerHeight;
  tip.style.left = `${left}px`;
  tip.style.top = `${fits ? below : Math.max(8, at.top - tip.offsetHeight - 6)}px`;
}

function hideTip() {
  tip.hidden = true;
}

for (const element of document.querySelectorAll("[title]")) {
  element.dataset.tip = element.title;
  element.removeAttribute("title");
  element.tabIndex = 0;
  element.setAttribute("aria-description", element.dataset.tip);
  element.addEventListener("pointerenter", () => showTip(element));
  element.addEventListener("focus", () => showTip(element));
  element.addEventListener("click", () => showTip(element));
  element.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && hideTip());
  element.addEventListener("blur", hideTip);
}
window.addEventListener("scroll", hideTip, { passive: true });
window.addEventListener("keydown", (event) => event.key === "Escape" && hideTip());
