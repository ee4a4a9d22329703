// The state of the selected draw.
{
  const place = document.getElementById("state-of"), values = document.getElementById("states");
  if (place && values) {
    const { parts, draws } = JSON.parse(values.textContent);
    onSelect((number) => {
      const own = number === null ? undefined : draws[number];
      if (!own) {
        place.replaceChildren(...(number === null ? [] : [element("p", {}, "The page has no state of draw " + number + ".")]));
        return;
      }
      const table = ([title, lines]) => [
        element("h3", {}, title),
        element("div", { class: "scroll" }, element("table", {}, element("tbody", {}, ...lines.map(([name, value]) =>
          element("tr", {}, element("th", { scope: "row" }, name), element("td", { class: "reason" }, value)))))),
      ];
      place.replaceChildren(element("p", {}, "Draw " + number + ", made by " + own.site + "."), ...own.parts.flatMap((part) => table(parts[part])));
    });
  }
}
