"use strict";
// Adds comfort to a page that is whole without it: rows as cards on a phone, copy buttons, a search box, links that
// unfold what they lead to, and everything unfolded in print.
for (const table of document.querySelectorAll(".scroll > table:not(.matrix)")) {
  const heads = Array.from(table.querySelectorAll("thead th"), (head) => head.textContent.trim());
  for (const row of table.tBodies[0]?.rows ?? []) {
    for (const cell of row.cells) if (cell.tagName === "TD" && cell.colSpan === 1) cell.dataset.label ??= heads[cell.cellIndex] ?? "";
  }
  table.classList.add("stacked");
}
const unfold = () => {
  const wanted = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!wanted) return;
  for (let part = wanted.closest("details"); part; part = part.parentElement.closest("details")) part.open = true;
  wanted.scrollIntoView();
};
addEventListener("hashchange", unfold);
unfold();
for (const source of document.querySelectorAll("[data-copy]")) {
  const button = document.createElement("button");
  const word = source.dataset.copy || "Copy";
  button.type = "button";
  if (source.tagName === "TABLE") button.className = "table";
  button.textContent = word;
  button.addEventListener("click", async () => {
    const rows = source.tagName === "TABLE" ? Array.from(source.rows, (row) => Array.from(row.cells, (cell) => cell.innerText.trim()).join("\t")) : null;
    try {
      await navigator.clipboard.writeText(rows ? rows.join("\n") : source.textContent);
      button.textContent = "Copied";
    } catch {
      // No clipboard for this page (an old browser, a page over plain HTTP): leave the text selected.
      getSelection().selectAllChildren(source);
      button.textContent = "Selected: copy with Ctrl+C";
    }
    setTimeout(() => { button.textContent = word; }, 2500);
  });
  const place = source.previousElementSibling;
  if (place && place.classList.contains("label")) place.append(button);
  else (source.closest(".scroll") || source).before(button);
}
const filter = document.querySelector(".filter");
if (filter) {
  const box = document.createElement("input");
  box.type = "search";
  box.placeholder = filter.dataset.search || "Search requirements";
  box.setAttribute("aria-label", box.placeholder);
  box.addEventListener("input", () => {
    const wanted = box.value.toLowerCase();
    for (const item of document.querySelectorAll("details[data-verdict], [data-found]")) item.classList.toggle("unmatched", !item.textContent.toLowerCase().includes(wanted));
  });
  filter.append(box);
}
// A page that is read long after it was written: what has expired since is not green any more.
for (const item of document.querySelectorAll("[data-until]")) {
  if (new Date(item.dataset.until) > new Date()) continue;
  for (const green of [item, ...item.querySelectorAll(".good")].filter((one) => one.classList.contains("good"))) green.classList.replace("good", "quiet");
  for (const sign of item.querySelectorAll(".sign")) if (sign.textContent === "✓") { sign.textContent = "○"; sign.setAttribute("aria-label", "expired"); }
  for (const word of item.querySelectorAll(".until")) word.textContent = "expired";
  item.dataset.may = "";
}
let folded = [];
addEventListener("beforeprint", () => {
  folded = Array.from(document.querySelectorAll("details:not([open])"));
  for (const item of folded) item.open = true;
});
addEventListener("afterprint", () => { for (const item of folded) item.open = false; });
