"use strict";
// Tables that sort by a column, and are filtered.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  table.querySelectorAll("thead th").forEach((head, column) => {
    const button = head.querySelector("button");
    if (!button) return;
    button.addEventListener("click", () => {
      const numbers = head.classList.contains("n");
      const up = head.getAttribute("aria-sort") === (numbers ? "descending" : "none") || !head.hasAttribute("aria-sort") && !numbers;
      const key = (row) => {
        const cell = row.cells[column], value = cell ? cell.dataset.value : undefined;
        if (!numbers) return cell ? cell.textContent : "";
        return value === undefined || value === "" ? NaN : Number(value);
      };
      // Empty cells come last, whichever way is sorted.
      const order = (a, b) => {
        const [x, y] = [key(a), key(b)];
        if (!numbers) return up ? x.localeCompare(y, "en") : y.localeCompare(x, "en");
        if (isNaN(x) || isNaN(y)) return isNaN(x) - isNaN(y);
        return up ? x - y : y - x;
      };
      const rows = [...body.rows].sort(order);
      table.querySelectorAll("thead th").forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      body.append(...rows);
    });
  });
}
for (const box of document.querySelectorAll(".filters")) {
  const table = document.getElementById(box.dataset.table), count = box.querySelector("output");
  const apply = () => {
    let shown = 0;
    for (const row of table.tBodies[0].rows) {
      const fits = [...box.querySelectorAll("[data-column]")].every((field) => {
        const cell = row.cells[field.dataset.column];
        if (field.value === "") return true;
        if (field.type === "number") return cell.dataset.value !== undefined && Number(cell.dataset.value) <= Number(field.value);
        return cell.textContent === field.value;
      });
      row.hidden = !fits;
      shown += fits;
    }
    if (count) count.textContent = shown + " of " + table.tBodies[0].rows.length;
  };
  box.addEventListener("input", apply);
  apply();
}
// Heat maps: each pixel of a picture holds a number of 24 bits; a canvas shows it in colours.
const VIRIDIS = [[68, 1, 84], [72, 40, 120], [62, 73, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121], [110, 206, 88], [181, 222, 43], [253, 231, 37]];
function shade(part) {
  const at = Math.max(0, Math.min(1, part)) * (VIRIDIS.length - 1), low = Math.min(VIRIDIS.length - 2, Math.floor(at));
  return VIRIDIS[low].map((value, c) => Math.round(value + (VIRIDIS[low + 1][c] - value) * (at - low)));
}
function hue(number) {
  const turn = (number * 0.6180339887) % 1, light = [0.62, 0.45, 0.78][number % 3], strong = 0.75 * Math.min(light, 1 - light);
  const part = (n) => { const k = (n + turn * 12) % 12; return Math.round(255 * (light - strong * Math.max(-1, Math.min(k - 3, 9 - k, 1)))); };
  return [part(0), part(8), part(4)];
}
async function numbers(image) {
  if (!image.complete) await new Promise((done) => image.addEventListener("load", done, { once: true }));
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const bytes = context.getImageData(0, 0, canvas.width, canvas.height).data, out = new Uint32Array(canvas.width * canvas.height);
  for (let i = 0; i < out.length; i++) out[i] = bytes[4 * i] << 16 | bytes[4 * i + 1] << 8 | bytes[4 * i + 2];
  return out;
}
const grouped = (n) => String(n).replace(/\B(?=(\d{3})+(?!\d))/g, ",");
for (const box of document.querySelectorAll(".maps")) {
  const about = JSON.parse(box.querySelector("script").textContent);
  const [canvas, readout, low, high, note] = ["canvas", ".readout", ".low", ".high", ".about"].map((name) => box.querySelector(name));
  const crosses = box.querySelectorAll(".cross"), buttons = box.querySelectorAll(".tabs button");
  const names = new Map(about.draws.map((draw) => [draw.number, draw]));
  const data = about.maps.map(() => null);
  [canvas.width, canvas.height] = [about.width, about.height];
  const load = async (at) => data[at] ??= await numbers(box.querySelectorAll("img.raw")[at]);
  async function show(at) {
    const values = await load(at), map = about.maps[at], context = canvas.getContext("2d");
    const image = context.createImageData(about.width, about.height);
    for (let i = 0; i < values.length; i++) {
      const value = values[i];
      const [r, g, b] = value === 0 ? [28, 28, 36] : map.draws ? hue(value) : shade(map.scale <= 1 ? 1 : 0.15 + 0.85 * (value - 1) / (map.scale - 1));
      image.data.set([r, g, b, 255], 4 * i);
    }
    context.putImageData(image, 0, 0);
    buttons.forEach((button, n) => button.setAttribute("aria-pressed", String(n === at)));
    box.querySelector(".scale").hidden = Boolean(map.draws);
    low.textContent = "1";
    high.textContent = map.scale < map.most ? grouped(map.scale) + " or more (most: " + grouped(map.most) + ")" : grouped(map.most);
    note.textContent = map.about;
    canvas.setAttribute("aria-label", map.name);
  }
  buttons.forEach((button, at) => button.addEventListener("click", () => show(at)));
  const point = async (event) => {
    const place = event.currentTarget.getBoundingClientRect();
    const [u, v] = [(event.clientX - place.left) / place.width, (event.clientY - place.top) / place.height];
    const x = Math.min(about.width - 1, Math.max(0, Math.floor(u * about.width))), y = Math.min(about.height - 1, Math.max(0, Math.floor(v * about.height)));
    crosses.forEach((cross) => { cross.style.display = "block"; cross.style.left = 100 * u + "%"; cross.style.top = 100 * v + "%"; });
    await Promise.all(about.maps.map((_, at) => load(at)));
    const cell = about.cell === 1 ? "pixel " + x + ", " + y : about.cell + "x" + about.cell + " pixels at " + x * about.cell + ", " + y * about.cell;
    readout.replaceChildren(cell);
    about.maps.forEach((map, at) => {
      const value = data[at][y * about.width + x], line = document.createElement("div");
      const draw = names.get(value - 1);
      line.textContent = map.draws
        ? map.name + ": " + (value === 0 ? "none" : "draw " + (value - 1) + (draw && draw.label ? " " + draw.label : "") + (draw ? ", pass " + draw.pass : ""))
        : map.name + ": " + grouped(value);
      readout.append(line);
    });
  };
  box.querySelectorAll(".heat").forEach((place) => {
    place.addEventListener("pointermove", point);
    place.addEventListener("pointerdown", point);
  });
  show(0);
}
