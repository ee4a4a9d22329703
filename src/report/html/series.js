// Over time: a cursor with the values there, and the span of the selected draw.
{
  const estimates = document.getElementById("estimates"), data = estimates ? JSON.parse(estimates.textContent).timeline : null;
  const charts = [...document.querySelectorAll("table.timeline")], when = document.querySelector(".when");
  if (data && charts.length) {
    const end = data.ends[data.ends.length - 1], hint = when.textContent;
    const begin = (sample) => sample > 0 ? data.ends[sample - 1] : 0;
    const spans = new Map(data.draws.map((draw) => [draw[0], draw]));
    const inside = (list, cycle) => list.find(([, from, to]) => from <= cycle && cycle < to);
    const part = (value) => (100 * value).toFixed(1) + " %";
    let cycle = null;
    const rows = charts.flatMap((chart) => [...chart.querySelectorAll("tr[data-kind]")]).map((row) => {
      const at = Number(row.dataset.at), cell = row.cells[2];
      return { kind: row.dataset.kind, unit: data.units[at], channel: data.channels[at], cell, mean: cell.textContent };
    });
    const draws = (at) => data.draws.length > 0 && document.querySelector("canvas.track") ? inside(data.draws, at) : undefined;
    function point(at, row) {
      cycle = at === null ? null : Math.max(0, Math.min(end - 1, Math.floor(at)));
      for (const chart of charts) chart.classList.toggle("pointed", cycle !== null);
      if (cycle === null) {
        for (const { cell, mean } of rows) cell.textContent = mean;
        when.textContent = hint;
        return;
      }
      const sample = data.ends.findIndex((last) => cycle < last), time = data.ends[sample] - begin(sample);
      const draw = draws(cycle), phase = inside(data.phases, cycle);
      const state = (unit, name) => unit[name][sample] / (time * unit.count);
      for (const { kind, unit, channel, cell } of rows) {
        if (kind === "unit") cell.textContent = part(state(unit, "busy"));
        if (kind === "warps") cell.textContent = state(unit, "held").toFixed(1);
        if (kind === "channel") cell.textContent = (channel.items[sample] / time).toFixed(1);
        if (kind === "draw") cell.textContent = draw ? grouped(draw[0]) : "\u2013";
      }
      for (const chart of charts) chart.style.setProperty("--at", cycle / end);
      const us = data.clock_mhz ? " (" + (cycle / data.clock_mhz).toFixed(2) + " \u03bcs)" : "";
      const unit = row && row.dataset.kind === "unit" ? data.units[row.dataset.at] : null;
      const states = [["busy", "busy"], ["blocked", "no room behind it"], ["memory", "waits for memory"], ["latency", "waits for instructions"]];
      when.textContent = "Cycle " + grouped(cycle) + us + [phase ? phase[0] : "", draw ? "draw " + draw[0] + (draw[3] ? ", " + draw[3] : "") : "",
        unit ? unit.unit + ": " + states.map(([name, text]) => text + " " + part(state(unit, name))).join(", ") : ""].filter(Boolean).map((text) => "; " + text).join("") + ".";
    }
    const pick = () => { const draw = cycle === null ? undefined : draws(cycle); if (draw) select(draw[0], true); };
    for (const chart of charts) {
      const follow = (event) => {
        const place = chart.querySelector("td.over > *").getBoundingClientRect(), share = (event.clientX - place.left) / place.width;
        point(share >= 0 && share <= 1 ? share * end : null, event.target.closest("tr"));
      };
      chart.addEventListener("pointermove", follow);
      chart.addEventListener("pointerleave", () => point(null));
      chart.addEventListener("click", (event) => { if (event.target.closest("td.over")) { follow(event); pick(); } });
      chart.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (!step && event.key !== "Enter") return;
        event.preventDefault();
        if (step) point((cycle ?? end / 2) + step * end / (event.shiftKey ? 20 : 200)); else pick();
      });
    }
    const track = document.querySelector("canvas.track");
    if (track) {
      const context = track.getContext("2d"), scale = track.width / end;
      for (const [number, from, to] of data.draws) {
        context.fillStyle = "rgb(" + hue(number + 1).join() + ")";
        context.fillRect(from * scale, 0, Math.max(1, (to - from) * scale), 1);
      }
    }
    onSelect((number) => {
      const span = spans.get(number);
      for (const chart of charts) {
        chart.classList.toggle("spanned", Boolean(span));
        if (span) [["--from", span[1] / end], ["--to", span[2] / end]].forEach(([name, value]) => chart.style.setProperty(name, value));
      }
    });
  }
}
