// Draws. `select(N)` selects the draw with this number on the whole page, and `select(null)` none: `document` gets the event `select`, whose
// `detail` is the number. Each part of the page follows it with `onSelect`. A link to `#draw-N` does the same.
let selected = null;
function onSelect(follow) {
  // Fields of text fire an event of this name, too; its target is the field.
  document.addEventListener("select", (event) => { if (event.target === document) follow(event.detail); });
}
function select(number, go) {
  selected = number;
  document.dispatchEvent(new CustomEvent("select", { detail: number }));
  const row = document.getElementById("draw-" + number);
  if (go && row) row.scrollIntoView({ block: "center" });
}
{
  const table = document.getElementById("draws"), rows = tables.get(table);
  const name = element("span", {}), places = element("span", {}), close = element("button", { type: "button", class: "plain", "aria-label": "Select no draw" }, "\u00d7");
  const bar = element("div", { class: "picked", role: "status" }, name, places, close);
  bar.hidden = true;
  document.body.append(bar);
  close.addEventListener("click", () => select(null));
  addEventListener("keydown", (event) => { if (event.key === "Escape" && selected !== null) select(null); });
  onSelect((number) => {
    for (const row of document.querySelectorAll("tr[aria-selected]")) row.removeAttribute("aria-selected");
    const row = number === null ? null : document.getElementById("draw-" + number);
    if (row) row.setAttribute("aria-selected", "true");
    if (rows) {
      for (const other of rows.all) other.tabIndex = other === (row || rows.all[0]) ? 0 : -1;
      rows.update();
    }
    bar.hidden = number === null;
    name.textContent = row ? row.dataset.name : "draw " + number;
    const parts = [["draw-" + number, "Row"], ["timeline", "Over time"], ["maps", "Heat maps"]];
    places.replaceChildren(...parts.filter(([id]) => document.getElementById(id)).map(([id, text]) => element("a", { href: "#" + id }, text)));
  });
  if (table) {
    const of = (event) => event.target.closest("tr[data-draw]");
    table.tBodies[0].addEventListener("click", (event) => {
      const row = of(event);
      if (row && getSelection().isCollapsed) select(selected === Number(row.dataset.draw) ? null : Number(row.dataset.draw));
    });
    table.tBodies[0].addEventListener("keydown", (event) => {
      const row = of(event), step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
      if (!row || !(step || event.key === "Enter" || event.key === " ")) return;
      event.preventDefault();
      let other = step ? row[step] : row;
      while (other && (other.hidden || !other.dataset.draw)) other = other[step];
      if (!other) return;
      select(Number(other.dataset.draw));
      other.focus();
    });
    if (rows.all[0]) rows.all[0].tabIndex = 0;
  }
  const follow = () => {
    const found = /^#draw-(\d+)$/.exec(location.hash);
    if (found) select(Number(found[1]), true);
  };
  addEventListener("hashchange", follow);
  // The other parts of the page follow by then.
  addEventListener("DOMContentLoaded", follow);
}
