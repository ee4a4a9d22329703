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
for (const box of document.querySelectorAll(".maps")) {
  const about = JSON.parse(box.querySelector("script").textContent);
  const [canvas, readout, low, high, note] = [".map", ".readout", ".low", ".high", ".about"].map((name) => box.querySelector(name));
  const crosses = box.querySelectorAll(".cross"), buttons = box.querySelectorAll(".tabs button"), layers = box.querySelectorAll(".chosen");
  const names = new Map(about.draws.map((draw) => [draw.number, draw]));
  const data = about.maps.map(() => null), last = about.maps.findIndex((map) => map.draws);
  let at = null, chosen = "";
  for (const own of [canvas, ...layers]) [own.width, own.height] = [about.width, about.height];
  const load = async (map) => data[map] ??= await numbers(box.querySelectorAll("img.raw")[map]);
  const paint = (own, color) => {
    const context = own.getContext("2d"), image = context.createImageData(about.width, about.height);
    for (let i = 0; i < about.width * about.height; i++) image.data.set(color(i), 4 * i);
    context.putImageData(image, 0, 0);
  };
  async function show(number) {
    const values = await load(number), map = about.maps[number], steps = map.scale - map.least;
    paint(canvas, (i) => {
      const value = values[i];
      return [...(value === 0 ? [28, 28, 36] : map.draws ? hue(value) : shade(steps > 0 ? 0.15 + 0.85 * (value - map.least) / steps : 1)), 255];
    });
    buttons.forEach((button, n) => button.setAttribute("aria-pressed", String(n === number)));
    box.querySelector(".scale").hidden = Boolean(map.draws) || map.most === 0;
    low.textContent = grouped(map.least);
    high.textContent = map.scale < map.most ? grouped(map.scale) + " or more (most: " + grouped(map.most) + ")" : grouped(map.most);
    note.textContent = map.about + (map.draws ? " Each draw has a colour of its own." : " The scale counts " + map.unit + ".");
    canvas.setAttribute("aria-label", map.name);
  }
  buttons.forEach((button, number) => button.addEventListener("click", () => show(number)));
  const named = (number) => {
    const draw = names.get(number);
    return "draw " + number + (draw && draw.label ? ", " + draw.label : "") + (draw ? ", pass " + draw.pass : "");
  };
  async function read() {
    if (!at) return;
    const [x, y] = at;
    crosses.forEach((cross) => { cross.style.display = "block"; cross.style.left = 100 * (x + 0.5) / about.width + "%"; cross.style.top = 100 * (y + 0.5) / about.height + "%"; });
    await Promise.all(about.maps.map((_, map) => load(map)));
    const cell = about.cell === 1 ? "pixel " + x + ", " + y : about.cell + "x" + about.cell + " pixels at " + x * about.cell + ", " + y * about.cell;
    readout.replaceChildren(cell, ...about.maps.map((map, n) => {
      const value = data[n][y * about.width + x];
      return element("div", {}, map.name + ": " + (map.draws ? value === 0 ? "none" : named(value - 1) : grouped(value) + " " + map.unit));
    }), ...(chosen ? [element("div", {}, chosen)] : []));
  }
  async function choose() {
    const value = (await load(last))[at[1] * about.width + at[0]];
    if (value > 0) select(value - 1, true);
  }
  onSelect(async (number) => {
    const values = await load(last);
    if (number !== selected) return;
    let own = 0;
    const dim = (i) => { const is = values[i] === number + 1; own += is; return [0, 0, 0, is ? 0 : 170]; };
    if (number !== null) paint(layers[0], dim);
    layers.forEach((layer, n) => {
      layer.hidden = own === 0;
      if (n > 0 && own > 0) layer.getContext("2d").clearRect(0, 0, about.width, about.height), layer.getContext("2d").drawImage(layers[0], 0, 0);
    });
    const cells = about.cell === 1 ? " pixels" : " cells of " + about.cell + "x" + about.cell + " pixels";
    chosen = number === null ? "" : own === 0 ? "Draw " + number + " is last at no pixel here." : "Highlighted: " + grouped(own) + cells + " where draw " + number + " is last.";
    readout.setAttribute("aria-live", "polite");
    if (at) read(); else if (chosen) readout.textContent = chosen;
  });
  const inside = (value, size) => Math.min(size - 1, Math.max(0, value));
  box.querySelectorAll(".heat").forEach((place) => {
    const point = (event) => {
      const edge = place.getBoundingClientRect();
      at = [inside(Math.floor((event.clientX - edge.left) / edge.width * about.width), about.width), inside(Math.floor((event.clientY - edge.top) / edge.height * about.height), about.height)];
      readout.setAttribute("aria-live", "off");
      return read();
    };
    place.addEventListener("pointermove", point);
    place.addEventListener("click", (event) => { point(event); choose(); });
    place.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!step && event.key !== "Enter") return;
      event.preventDefault();
      readout.setAttribute("aria-live", "polite");
      const by = event.shiftKey ? 8 : 1;
      at = at ? at.map((value, n) => inside(value + (step ? by * step[n] : 0), n ? about.height : about.width)) : [about.width >> 1, about.height >> 1];
      if (step) read(); else choose();
    });
  });
  show(0);
}
