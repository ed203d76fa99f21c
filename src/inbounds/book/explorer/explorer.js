// The study to choose from. `chosen` is a pure function from the page's data and the reader's choice to what is shown;
// the rest draws it. All numbers and all verdicts are in the data: here they are looked up, and points are placed.
"use strict";

// data: of inbounds.book.explorer.choices. choice: { start, algorithm, endpoint, families, robots }, the last two sets.
inbounds.chosen = (data, choice) => {
  const where = `${choice.start}-${choice.algorithm}`;
  const key = `${where}-${choice.endpoint}`;
  const robots = data.robots.filter((robot) => choice.robots.has(robot));
  const families = Object.keys(data.families).filter((family) => choice.families.has(family));
  const planned = data.pairs[where].filter(([first, second]) => families.includes(first) && families.includes(second));
  const all = data.rows[key] ?? [];
  const forest = robots
    .map((robot) => ({
      robot,
      rows: planned.flatMap(([first, second, label]) =>
        all
          .filter((row) => row.robot === robot && row.pair[0] === first && row.pair[1] === second)
          .map((row) => ({ ...row, label })),
      ),
    }))
    .filter(({ rows }) => rows.length);

  const said = planned.map(([first, second, label]) => {
    const there = all.filter((row) => row.pair[0] === first && row.pair[1] === second).map((row) => row.robot);
    const bits = robots.filter((robot) => there.includes(robot)).reduce((sum, r) => sum + 2 ** data.robots.indexOf(r), 0);
    const told = data.sentences[key]?.[`${first},${second}`];
    return { label, text: told ? data.texts[told[bits]] : "not run yet" };
  });

  const lacking = planned.flatMap(([first, second, label]) => {
    const without = robots.filter(
      (robot) => !all.some((row) => row.robot === robot && row.pair[0] === first && row.pair[1] === second),
    );
    if (!without.length) return [];
    return [`${label} on ${without.length === data.robots.length ? "all robots" : without.join(", ")}`];
  });
  const there = forest.reduce((sum, { rows }) => sum + rows.length, 0);

  const panels = robots.flatMap((robot) => {
    const curves = (data.curves[where]?.[robot] ?? []).filter((curve) => families.includes(curve.family));
    return curves.length ? [{ robot, curves }] : [];
  });
  const unplanned = families.filter((family) => !data.pairs[where].some((pair) => pair.includes(family)));
  return { forest, said, panels, lacking, there, planned: planned.length * robots.length, unplanned };
};

(() => {
  const { make, draw, color, followWidth, startAll } = inbounds.page;
  const ADDRESS = "#study?";
  const write = (x) => String(Number(x.toPrecision(3))).replace("-", "−");

  // At most `count` round numbers from low to high.
  function ticks(low, high, count) {
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= rough);
    const found = [];
    for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(i * step);
    return found;
  }

  function swatch(data, { family, thin }) {
    const svg = draw("svg", { width: 30, height: 8, "aria-hidden": "true" });
    const { dash } = data.looks[family];
    svg.append(draw("line", { x1: 0, x2: 30, y1: 4, y2: 4, stroke: color(family), "stroke-width": thin ? 1.5 : 3, "stroke-dasharray": dash.join(" ") }));
    return svg;
  }

  function panel(data, { robot, curves }, endpoint, width) {
    const [height, left, right, top, bottom] = [170, 48, 8, 8, 34];
    const x = (v) => left + ((width - left - right) * v) / data.epochs.at(-1);
    const low = Math.min(...curves.flatMap((curve) => curve.low));
    const high = Math.max(...curves.flatMap((curve) => curve.high));
    const y = (v) => height - bottom - ((height - top - bottom) * (v - low)) / (high - low || 1);
    const named = curves.map((curve) => `${curve.name} ${curve.told[endpoint]}`);
    const svg = draw("svg", { width, height, role: "img", "aria-label": `${robot}, learning curves; ${data.endpoints[endpoint]}: ${named.join("; ")}` });
    for (const tick of ticks(low, high, 4)) {
      svg.append(draw("line", { x1: left, x2: width - right, y1: y(tick), y2: y(tick), stroke: color("grid") }));
      svg.append(draw("text", { x: left - 5, y: y(tick) + 4, "text-anchor": "end" }, write(tick)));
    }
    for (const tick of ticks(0, data.epochs.at(-1), 4)) svg.append(draw("text", { x: x(tick), y: height - bottom + 15, "text-anchor": "middle" }, write(tick)));
    svg.append(draw("text", { x: (left + width - right) / 2, y: height - 3, "text-anchor": "middle" }, "env steps per seed [millions]"));
    const path = (values) => values.map((v, i) => `${x(data.epochs[i]).toFixed(1)},${y(v).toFixed(1)}`);
    for (const { family, thin, value, low: under, high: over } of curves) {
      const band = [...path(under), ...path(over).reverse()].join(" ");
      svg.append(draw("polygon", { points: band, fill: color(family), "fill-opacity": 0.18 }));
      svg.append(draw("polyline", { points: path(value).join(" "), fill: "none", stroke: color(family), "stroke-width": thin ? 1.3 : 2.4, "stroke-dasharray": data.looks[family].dash.join(" ") }));
    }
    const legend = make("ul");
    for (const curve of curves) {
      legend.append(make("li", {}, swatch(data, curve), `${curve.name} ${curve.told[endpoint]}`));
    }
    return make("div", {}, make("p", { class: "explorer-head" }, robot), svg, legend);
  }

  // One row of the forest: interval and value, in margins, on the axis that all rows share.
  function bar(row, x, width) {
    const [low, value, high] = row.ends;
    const hue = color(row.pair[1] === "gaussian" ? row.pair[0] : "line");
    const svg = draw("svg", { width, height: 20, "aria-hidden": "true" });
    svg.append(draw("rect", { x: x(-1), width: x(1) - x(-1), y: 0, height: 20, fill: color("grid"), "fill-opacity": 0.6 }));
    svg.append(draw("line", { x1: x(0), x2: x(0), y1: 0, y2: 20, stroke: color("line") }));
    svg.append(draw("line", { x1: x(low), x2: x(high), y1: 10, y2: 10, stroke: hue, "stroke-width": 3 }));
    svg.append(draw("circle", { cx: x(value), cy: 10, r: 5, stroke: hue, "stroke-width": 2, fill: row.filled ? hue : color("page") }));
    return svg;
  }

  function forest(data, groups, width, wide) {
    const ends = groups.flatMap(({ rows }) => rows.flatMap((row) => row.ends));
    const [low, high] = [Math.min(-1.2, ...ends), Math.max(1.2, ...ends)];
    const x = (v) => 8 + ((width - 16) * (v - low)) / (high - low);
    const nodes = groups.flatMap(({ robot, rows }) => [
      make("p", { class: "explorer-head" }, robot),
      ...rows.map((row) => make("div", { class: "explorer-row" }, make("span", { class: "name" }, row.label), bar(row, x, width), make("span", { class: "told" }, row.told))),
    ]);
    const axis = draw("svg", { width, height: 34, "aria-hidden": "true" });
    axis.append(draw("line", { x1: 8, x2: width - 8, y1: 1, y2: 1, stroke: color("line") }));
    for (const tick of ticks(low, high, wide ? 6 : 4)) axis.append(draw("text", { x: x(tick), y: 15, "text-anchor": "middle" }, write(tick)));
    axis.append(draw("text", { x: width / 2, y: 31, "text-anchor": "middle" }, "difference, in fifths of what training adds"));
    return [...nodes, make("div", { class: "explorer-row" }, make("span"), axis)];
  }

  function sentence(data, choice, shown) {
    const said = shown.said.map(({ label, text }) => make("p", {}, make("strong", {}, label), `: ${text}.`));
    if (!choice.robots.size) return [make("p", {}, "Choose a robot.")];
    if (!said.length) return [make("p", {}, "No two of these families are compared here: choose another.")];
    const head = `${data.endpoints[choice.endpoint]}, ${choice.algorithm.toUpperCase()}, ${data.starts[choice.start]}`;
    return [make("p", {}, `${head[0].toUpperCase()}${head.slice(1)}.`), ...said];
  }

  function start(container) {
    const data = JSON.parse(container.querySelector("script[type='application/json']").textContent);
    const form = container.querySelector("form");
    const live = container.querySelector(".explorer-live");
    const place = (name) => container.querySelector(`.explorer-${name}`);
    const link = container.closest("article") && make("a", {}, "Link to this view"); // in a notebook the address is the editor's
    let width = 0;

    // Chooses what an address says, and returns whether it is one; a name that it does not know stays as it was.
    function follow() {
      if (!link || !location.hash.startsWith(ADDRESS)) return false;
      const asked = new URLSearchParams(location.hash.slice(ADDRESS.length));
      for (const input of form.querySelectorAll("input")) {
        const wanted = asked.getAll(input.name).includes(input.value);
        if (wanted || input.type === "checkbox") input.checked = wanted;
      }
      container.scrollIntoView();
      return true;
    }

    function show() {
      const answers = new FormData(form);
      const one = (name) => answers.get(name);
      const choice = { start: one("start"), algorithm: one("algorithm"), endpoint: one("endpoint"), families: new Set(answers.getAll("family")), robots: new Set(answers.getAll("robot")) };
      const shown = inbounds.chosen(data, choice);
      const wide = globalThis.matchMedia("(min-width: 40.01rem)").matches;
      const em = parseFloat(getComputedStyle(document.documentElement).fontSize);
      place("said").replaceChildren(...sentence(data, choice, shown));
      const strip = shown.lacking.length ? [`${shown.there} of ${shown.planned} differences are there. Not finished: ${shown.lacking.join("; ")}.`] : [];
      if (shown.unplanned.length) strip.push(`Not planned for this start and algorithm: ${shown.unplanned.map((f) => data.families[f]).join(", ")}.`);
      place("missing").textContent = strip.join(" ");
      place("forest").replaceChildren(...(shown.forest.length ? forest(data, shown.forest, wide ? width - 25.25 * em : width, wide) : []));
      const columns = Math.max(1, Math.floor((width + em) / (18 * em)));
      const each = Math.floor((width - (columns - 1) * em) / columns);
      place("panels").replaceChildren(...shown.panels.map((found) => panel(data, found, choice.endpoint, each)));
      if (link) link.href = ADDRESS + new URLSearchParams(answers);
    }

    form.addEventListener("change", show);
    form.addEventListener("submit", (event) => event.preventDefault());
    container.querySelector(".explorer-static").hidden = true;
    live.hidden = false;
    if (link) {
      live.after(make("p", { class: "explorer-link" }, link));
      addEventListener("hashchange", () => {
        if (follow()) show(); // most changes are links to other places of the page
      });
    }
    follow();
    followWidth(live, (room) => {
      width = room;
      show();
    });
    container.dataset.state = "live";
  }

  startAll("inbounds-study-explorer", start);
})();
