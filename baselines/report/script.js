"use strict";
// pages are whole without this: it unpacks a figure's files on request, and lets moving pictures be stopped
document.querySelectorAll("figure").forEach((figure, number) => {
  const image = figure.querySelector("img"), files = figure.querySelector(".files"), player = figure.querySelector(".player");
  if (files) {
    files.hidden = false;
    files.querySelectorAll("a").forEach((link) => link.addEventListener("click", async (event) => {
      if (link.getAttribute("href") !== "#") return;
      event.preventDefault();
      const kind = link.dataset.kind, type = { csv: "text/csv", svg: "image/svg+xml", png: "image/png" }[kind];
      const bytes = Uint8Array.from(atob(link.dataset.file || image.src.split(",")[1]), (c) => c.charCodeAt(0));
      const stream = new Blob([bytes]).stream();
      const whole = await new Response(link.dataset.file ? stream.pipeThrough(new DecompressionStream("gzip")) : stream).blob();
      link.href = URL.createObjectURL(new Blob([whole], { type }));
      link.download = `figure_${number + 1}.${kind}`;
      link.click();
    }));
  }
  if (player) {
    const frames = figure.querySelector("script").textContent.split(" ");
    const button = player.querySelector("button"), slider = player.querySelector("input");
    const head = image.src.split(",")[0];
    let at = 0, timer = null;
    const show = (i) => { at = i % frames.length; slider.value = at; image.src = `${head},${frames[at]}`; };
    const stop = () => { clearInterval(timer); timer = null; button.textContent = "▶"; };
    const start = () => { timer = setInterval(() => show(at + 1), 100); button.textContent = "❚❚"; };
    button.addEventListener("click", () => (timer ? stop() : start()));
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    player.hidden = false;
    // who asked their system for less motion begins with the whole run at rest
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) { stop(); show(frames.length - 1); } else { start(); }
  }
});
// a table of some length is sorted by its columns: numbers by what they begin with, what has none last
document.querySelectorAll("table").forEach((table) => {
  const body = table.tBodies[0], heads = table.tHead ? [...table.tHead.rows[0].cells] : [];
  if (!body || body.rows.length < 4) return;
  const value = (row, i) => {
    const text = row.cells[i].textContent.trim(), number = parseFloat(text.replace("−", "-").replace(/^[<>≤≥±]/, ""));
    return heads[i].classList.contains("n") ? number : text;
  };
  heads.forEach((head, i) => {
    const sort = () => {
      const down = head.getAttribute("aria-sort") === "ascending", sign = down ? -1 : 1;
      heads.forEach((other) => other.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const order = (a, b) => {
        const x = value(a, i), y = value(b, i);
        if (typeof x === "string") return sign * x.localeCompare(y);
        return Number.isNaN(x) || Number.isNaN(y) ? Number.isNaN(x) - Number.isNaN(y) : sign * (x - y);
      };
      body.append(...[...body.rows].sort(order));
    };
    head.setAttribute("aria-sort", "none");
    head.tabIndex = 0;
    head.addEventListener("click", sort);
    head.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); sort(); } });
  });
});
// a link into what is folded opens it
const unfold = () => {
  let target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (; target; target = target.parentElement) if (target.tagName === "DETAILS") target.open = true;
};
addEventListener("hashchange", unfold);
unfold();
