"use strict";
// Tables that sort by a column, show the first rows or all, leave out rows that a filter does not match, and columns that are not chosen.
const TOP = 20;
const grouped = (n) => String(n).replace(/\B(?=(\d{3})+(?!\d))/g, ",");
function element(name, attributes, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}
class Rows {
  constructor(table) {
    [this.table, this.tests, this.most, this.counted] = [table, [], Infinity, () => {}];
  }
  get all() { return [...this.table.tBodies[0].rows]; }
  // A selected row is shown always.
  update() {
    let found = 0;
    for (const row of this.all) {
      const fits = this.tests.every((test) => test(row));
      found += fits;
      row.hidden = !(fits && found <= this.most) && row.getAttribute("aria-selected") !== "true";
    }
    this.counted(found);
  }
}
const tables = new Map([...document.querySelectorAll("table.sortable")].map((table) => [table, new Rows(table)]));
for (const [table, rows] of tables) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = head.querySelector("button");
    if (!button) return;
    if (head.textContent === table.dataset.sorted) head.setAttribute("aria-sort", "descending");
    button.addEventListener("click", () => {
      const numbers = head.classList.contains("n");
      const up = head.getAttribute("aria-sort") === (numbers ? "descending" : "none") || !head.hasAttribute("aria-sort") && !numbers;
      const key = (row) => {
        const cell = row.cells[column], value = cell ? cell.dataset.value : undefined;
        if (!numbers) return cell ? cell.textContent : "";
        return value === undefined || value === "" ? NaN : Number(value);
      };
      // Empty cells come last in both directions.
      const order = (a, b) => {
        const [x, y] = [key(a), key(b)];
        if (!numbers) return up ? x.localeCompare(y, "en") : y.localeCompare(x, "en");
        if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
        return up ? x - y : y - x;
      };
      const sorted = rows.all.sort(order);
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      body.append(...sorted);
      rows.update();
    });
  });
  const box = table.closest(".tall"), all = body.rows.length;
  if (!box) continue;
  const tools = element("div", { class: "tools" });
  if (all > TOP) {
    const filter = element("input", { type: "search", placeholder: "Filter rows", "aria-label": "Filter rows" });
    rows.tests.push((row) => filter.value.toLowerCase().split(" ").every((word) => row.textContent.toLowerCase().includes(word)));
    filter.addEventListener("input", () => rows.update());
    tools.append(filter);
    const button = element("button", { type: "button", class: "plain" }), count = element("span", {});
    button.addEventListener("click", () => {
      rows.most = rows.most === TOP ? Infinity : TOP;
      rows.update();
    });
    rows.most = TOP;
    rows.counted = (found) => {
      const by = heads.find((head) => head.hasAttribute("aria-sort")), few = rows.most === TOP;
      box.classList.toggle("few", few);
      button.hidden = found <= TOP;
      button.textContent = few ? "Show all " + grouped(found) : "Show the top " + TOP;
      count.textContent = grouped(Math.min(found, rows.most)) + " of " + grouped(all) + " rows" + (by ? ", by " + by.textContent : "");
    };
    box.after(element("div", { class: "more" }, count, button));
  }
  if (table.dataset.shown) {
    const shown = table.dataset.shown.split("|"), list = element("div", {});
    heads.forEach((head, column) => {
      const check = element("input", { type: "checkbox" });
      const show = () => [head, ...rows.all.map((row) => row.cells[column])].forEach((cell) => { cell.hidden = !check.checked; });
      check.checked = shown.includes(head.textContent);
      check.addEventListener("change", show);
      list.append(element("label", {}, check, head.textContent || "\u2013"));
      show();
    });
    tools.append(element("details", { class: "columns" }, element("summary", {}, "Columns"), list));
  }
  if (tools.children.length) box.before(tools);
  rows.update();
}
for (const box of document.querySelectorAll(".filters")) {
  const table = document.getElementById(box.dataset.table), count = box.querySelector("output"), rows = tables.get(table);
  const told = rows.counted;
  rows.counted = (found) => {
    told(found);
    if (count) count.textContent = found + " of " + table.tBodies[0].rows.length;
  };
  rows.tests.push((row) => [...box.querySelectorAll("[data-column]")].every((field) => {
    const cell = row.cells[field.dataset.column];
    if (field.value === "") return true;
    if (field.type === "number") return cell.dataset.value !== undefined && Number(cell.dataset.value) <= Number(field.value);
    return cell.textContent === field.value;
  }));
  box.addEventListener("input", () => rows.update());
  rows.update();
}
// The index marks the section that is read.
{
  const links = new Map([...document.querySelectorAll("nav.index a")].map((link) => [link.hash.slice(1), link]));
  const sections = [...document.querySelectorAll("main > section")];
  let marked = null;
  const mark = () => {
    const read = sections.filter((section) => section.getBoundingClientRect().top < innerHeight / 3).pop() || sections[0];
    if (!read || read.id === marked) return;
    marked = read.id;
    for (const [id, link] of links) {
      if (id !== marked) { link.removeAttribute("aria-current"); continue; }
      link.setAttribute("aria-current", "true");
      const list = link.parentElement;
      list.scrollTo({ left: link.offsetLeft - list.clientWidth / 2, top: link.offsetTop - list.clientHeight / 2 });
    }
  };
  addEventListener("scroll", mark, { passive: true });
  mark();
}
// The drawing of the machine fits its box, or has its own size.
for (const box of document.querySelectorAll(".diagram")) {
  const button = element("button", { type: "button", class: "plain", "aria-pressed": "false" }, "Full size");
  button.addEventListener("click", () => button.setAttribute("aria-pressed", String(box.classList.toggle("whole"))));
  box.before(button);
  button.hidden = box.scrollWidth >= box.querySelector("svg").getAttribute("width");
}
