// Pick your own seeds. `inbounds.seeds` is arithmetic: Welch's comparison of a few results, and the same for every way
// to take so many of each side. The rest draws it. The study's own differences of all seeds are in the page's data.
"use strict";

inbounds.seeds = (() => {
  const { betaCdf, bisect } = inbounds.numerics;

  // P(|T| > t) of Student's law, and the t that leaves 5 % outside.
  const outside = (t, freedom) => betaCdf(freedom / (freedom + t * t), freedom / 2, 0.5);
  function reach(freedom) {
    let far = 2;
    while (outside(far, freedom) > 0.05) far *= 2;
    return bisect((t) => outside(t, freedom) - 0.05, 0, far);
  }

  function condensed(values) {
    const mean = values.reduce((sum, x) => sum + x, 0) / values.length;
    const square = values.reduce((sum, x) => sum + (x - mean) ** 2, 0);
    return { mean, part: square / (values.length - 1) / values.length, n: values.length };
  }
  function together(a, b) {
    const variance = a.part + b.part;
    return { value: a.mean - b.mean, error: Math.sqrt(variance), freedom: variance ** 2 / (a.part ** 2 / (a.n - 1) + b.part ** 2 / (b.n - 1)) };
  }

  // Difference of means with its 95 % interval; at least two results a side.
  function welch(first, second) {
    const { value, error, freedom } = together(condensed(first), condensed(second));
    const half = reach(freedom) * error;
    return { low: value - half, value, high: value + half };
  }

  function* choices(values, count, from = 0) {
    if (count === 0) yield [];
    for (let i = from; count > 0 && i <= values.length - count; i++) {
      for (const rest of choices(values, count - 1, i + 1)) yield [values[i], ...rest];
    }
  }

  // What every way to take so many of each side reports: gaps, and by the interval 1 higher, −1 lower, 0 neither.
  function reports(first, second, [m, n]) {
    const [a, b] = [[first, m], [second, n]].map(([values, count]) => Array.from(choices(values, count), condensed));
    const surely = reach(Math.min(m, n) - 1); // Welch's degrees of freedom are no fewer
    const gaps = [];
    const found = [];
    for (const one of a) {
      for (const other of b) {
        const { value, error, freedom } = together(one, other);
        const t = Math.abs(value) / error;
        gaps.push(value);
        found.push(t > surely || (t > 1.95 && outside(t, freedom) < 0.05) ? Math.sign(value) : 0);
      }
    }
    const share = (sides, side) => sides.filter((each) => Math.sign(each) === side).length / sides.length;
    const shares = (sides) => ({ higher: share(sides, 1), nothing: share(sides, 0), lower: share(sides, -1) });
    return { gaps, found, means: shares(gaps), interval: shares(found) };
  }

  const minus = (text) => text.replace("-", "−");
  const number = (x) => minus(Math.abs(x) >= 100 ? x.toFixed(0) : x.toFixed(1).replace(/^-0\.0$/, "0.0"));
  const spoken = ({ low, value, high }) => `${number(value)} [${number(low)}, ${number(high)}]`;
  const verdict = ({ low, high }) => {
    if (low > 0 || high < 0) return low > 0 ? "above" : "below";
    return `no difference found (effects between ${number(low)} and ${number(high)} points remain possible)`;
  };
  return { welch, reports, number, spoken, verdict };
})();

(() => {
  const { welch, reports, number, spoken, verdict } = inbounds.seeds;
  const { make, draw, color, followWidth, startAll } = inbounds.page;
  const round = (x) => number(Number(x.toPrecision(2)));
  const thousands = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, "\u202f");
  const percent = (x) => (x > 0 && x < 0.001 ? "under 0.1\u202f%" : `${(100 * x).toFixed(x > 0 && x < 0.1 ? 1 : 0)}\u202f%`);

  // Every seed's result as a dot, a row a side; ticked ones are filled, and a bar stands at their mean.
  function dots(svg, sides, names, top, width) {
    const all = sides.flatMap((side) => side.values);
    const [low, high] = [Math.min(...all), Math.max(...all)];
    const x = (v) => 12 + ((width - 24) * (v - low)) / (high - low || 1);
    sides.forEach(({ family, values, ticked }, row) => {
      const y = top + 34 * row + 26;
      svg.append(draw("text", { x: 0, y: y - 12 }, `${names[row]}, final return of each seed`));
      svg.append(draw("line", { x1: 0, x2: width, y1: y, y2: y, stroke: color("grid") }));
      values.forEach((v, i) => {
        svg.append(draw("circle", { cx: x(v), cy: y, r: 5, stroke: color(family), "stroke-width": 2, fill: ticked[i] ? color(family) : "none" }));
      });
      const chosen = values.filter((_, i) => ticked[i]);
      const mean = chosen.reduce((sum, v) => sum + v, 0) / chosen.length;
      if (chosen.length) svg.append(draw("line", { x1: x(mean), x2: x(mean), y1: y - 9, y2: y + 9, stroke: color("ink"), "stroke-width": 3 }));
    });
    svg.append(draw("text", { x: 0, y: top + 96 }, round(low)), draw("text", { x: width, y: top + 96, "text-anchor": "end" }, `${round(high)} points`));
  }

  // All reports as bars; within a bar, from below: lower found, nothing found, higher found.
  function histogram(svg, every, [first, second], marks, top, width) {
    const [low, high] = [Math.min(...every.gaps), Math.max(...every.gaps)];
    const count = 41;
    const bins = Array.from({ length: count }, () => [0, 0, 0]);
    every.gaps.forEach((gap, i) => {
      const bin = Math.min(count - 1, Math.floor((count * (gap - low)) / (high - low || 1)));
      bins[bin][every.found[i] + 1] += 1;
    });
    const height = 96;
    const tallest = Math.max(...bins.map(([a, b, c]) => a + b + c));
    const x = (v) => (width * (v - low)) / (high - low || 1);
    const base = top + 34 + height;
    svg.append(draw("text", { x: 0, y: top + 12 }, "All reports, by the difference of means"));
    bins.forEach((parts, i) => {
      let from = base;
      parts.forEach((part, side) => {
        const tall = (height * part) / tallest;
        from -= tall;
        const fill = color([second, "line", first][side]);
        if (tall) svg.append(draw("rect", { x: (width * i) / count + 0.5, width: width / count - 1, y: from, height: tall, fill, "fill-opacity": side === 1 ? 0.45 : 1 }));
      });
    });
    svg.append(draw("line", { x1: 0, x2: width, y1: base, y2: base, stroke: color("line") }));
    const at = (v) => Math.min(width - 1, Math.max(1, x(v)));
    const anchor = (v) => (at(v) < 60 ? "start" : at(v) > width - 60 ? "end" : "middle");
    for (const [v, name, y] of marks) {
      svg.append(draw("line", { x1: at(v), x2: at(v), y1: y, y2: base, stroke: color("ink"), "stroke-width": 2, "stroke-dasharray": name === "yours" ? "none" : "4 3" }));
      svg.append(draw("text", { x: at(v), y: base + (name === "yours" ? 28 : 14), "text-anchor": anchor(v) }, `${name}: ${number(v)}`));
    }
    if (low < 0 && high > 0) svg.append(draw("line", { x1: x(0), x2: x(0), y1: base - height, y2: base, stroke: color("line"), "stroke-dasharray": "1 3" }));
    const legend = [[first, "higher found"], ["line", "nothing found"], [second, "lower found"]];
    legend.forEach(([hue, name], i) => {
      const left = (width * i) / 3;
      svg.append(draw("rect", { x: left, y: base + 36, width: 12, height: 12, fill: color(hue), "fill-opacity": hue === "line" ? 0.45 : 1 }));
      svg.append(draw("text", { x: left + 17, y: base + 46 }, name));
    });
  }

  function start(container) {
    const data = JSON.parse(container.querySelector("script[type='application/json']").textContent);
    const form = container.querySelector("form");
    const live = container.querySelector(".seeds-live");
    const [robots, algorithms, pairs] = ["robot", "algorithm", "pair"].map((name) => form.elements[name]);
    const fieldsets = [...form.querySelectorAll("fieldset")];
    const name = (family) => data.families[family];
    const within = (family) => name(family).replace("Logit", "logit"); // in a sentence
    const called = ({ pair }) => `${name(pair[0])} − ${name(pair[1])}`;
    const known = new Map(); // reports by place and numbers of seeds
    let width = 0;

    const rows = () => data.rows.filter((row) => row.robot === robots.value && row.algorithm === algorithms.value);
    const chosen = () => rows().find((row) => row.pair.join() === pairs.value);
    const boxes = (side) => [...fieldsets[side].querySelectorAll("input")];

    function fill(select, options) {
      const before = select.value;
      select.replaceChildren(...options.map(([value, text]) => make("option", { value }, text)));
      if (options.some(([value]) => value === before)) select.value = before;
    }
    function fillPlaces() {
      const open = data.algorithms.filter((each) => data.rows.some((row) => row.robot === robots.value && row.algorithm === each));
      fill(algorithms, open.map((each) => [each, each.toUpperCase()]));
      fill(pairs, rows().map((row) => [row.pair.join(), called(row)]));
      chosen().pair.forEach((family, side) => {
        const count = data.results[`${robots.value}-${algorithms.value}-${family}`].length;
        const kept = boxes(side).length ? boxes(side).map((box) => box.checked) : Array(data.ticked).fill(true);
        fieldsets[side].querySelector("legend").textContent = `Seeds of the ${within(family)}`;
        fieldsets[side].querySelectorAll("label").forEach((label) => label.remove());
        for (let i = 0; i < count; i++) {
          const box = make("input", { type: "checkbox", name: `side-${side}` });
          box.checked = Boolean(kept[i]);
          fieldsets[side].append(make("label", {}, box, String(i)));
        }
      });
    }

    const sides = () =>
      chosen().pair.map((family, side) => ({
        family,
        values: data.results[`${robots.value}-${algorithms.value}-${family}`],
        ticked: boxes(side).map((box) => box.checked),
      }));
    const taken = ({ values, ticked }) => values.filter((_, i) => ticked[i]);

    function everyReport(both, counts) {
      const key = [robots.value, algorithms.value, pairs.value, ...counts].join();
      if (!known.has(key)) known.set(key, reports(both[0].values, both[1].values, counts));
      return known.get(key);
    }

    function show() {
      const row = chosen();
      const both = sides();
      const counts = both.map((side) => taken(side).length);
      const names = row.pair.map(name);
      const enough = Math.min(...counts) >= 2;
      const every = enough ? everyReport(both, counts) : null;
      const mine = enough ? welch(taken(both[0]), taken(both[1])) : null;
      const whole = `All seeds, n = ${both.map(({ values }) => values.length).join(" and ")}, the study's interval: ${row.told}.`;
      const [first, second] = row.pair.map(within);
      const place = `${first} minus ${second}, ${row.robot}, ${row.algorithm.toUpperCase()}, n = ${counts.join(" and ")}`;
      const side = mine ? (mine.value > 0 ? "higher" : "lower") : "";
      const said = mine
        ? [`Your report: ${place}: ${spoken(mine)} points.`, `By the two means you would have written that the ${first} ends ${side}. By the interval: ${verdict(mine)}.`]
        : ["Tick at least two seeds a side: an interval needs them."];
      container.querySelector(".seeds-said").replaceChildren(...[...said, whole].map((text) => make("p", {}, text)));

      const table = container.querySelector("table");
      table.hidden = !every;
      if (every) {
        table.caption.textContent = `All ${thousands(every.gaps.length)} ways to take ${counts[0]} of the ${first}'s seeds and ${counts[1]} of the ${second}'s, counted one by one. They say that the ${first} ends …`;
        ["means", "interval"].forEach((rule, i) => {
          const { higher, nothing, lower } = every[rule];
          const texts = [percent(higher), rule === "means" && nothing === 0 ? "–" : percent(nothing), percent(lower)];
          texts.forEach((text, j) => (table.tBodies[0].rows[i].cells[j + 1].textContent = text));
        });
      }
      const results = both.map((each, i) => `${names[i]}: ${each.values.map((v, j) => `seed ${j} ${number(v)}${each.ticked[j] ? ", ticked" : ""}`).join("; ")}`);
      const svg = draw("svg", { width, height: every ? 292 : 104, role: "img", "aria-label": `Final return of each seed. ${results.join(". ")}.` });
      dots(svg, both, names, 0, width);
      if (every) histogram(svg, every, row.pair, [[row.value, "all seeds", 146], [mine.value, "yours", 136]], 110, width);
      container.querySelector(".seeds-plot").replaceChildren(svg);
    }

    function tick(pick) {
      sides().forEach(({ values }, side) => {
        const order = values.map((_, i) => i);
        const keep = new Set(pick(order, values, side));
        boxes(side).forEach((box, i) => (box.checked = keep.has(i)));
      });
      show();
    }
    const shuffled = (order) => order.map((i) => [Math.random(), i]).sort(([a], [b]) => a - b).map(([, i]) => i);
    const extreme = (top) => (order, values, side) => {
      const upwards = [...order].sort((i, j) => values[i] - values[j]);
      return side === top ? upwards.slice(-data.ticked) : upwards.slice(0, data.ticked);
    };
    const BUTTONS = [
      ["Three at random", (order) => shuffled(order).slice(0, data.ticked)],
      ["Best for the first", extreme(0)],
      ["Best for the second", extreme(1)],
      ["All", (order) => order],
    ];
    for (const [text, pick] of BUTTONS) {
      const button = make("button", { type: "button" }, text);
      button.addEventListener("click", () => tick(pick));
      container.querySelector(".seeds-buttons").append(button);
    }

    fill(robots, data.robots.map((robot) => [robot, robot]));
    robots.value = data.rows[0].robot;
    fillPlaces();
    algorithms.value = data.rows[0].algorithm;
    fillPlaces();
    pairs.value = data.rows[0].pair.join();
    fillPlaces();
    form.addEventListener("change", (event) => {
      if (event.target.tagName === "SELECT") fillPlaces();
      show();
    });
    form.addEventListener("submit", (event) => event.preventDefault());
    container.querySelector(".seeds-static").hidden = true;
    live.hidden = false;
    followWidth(live, (room) => {
      width = room;
      show();
    });
    container.dataset.state = "live";
  }

  startAll("inbounds-picked-seeds", start);
})();
