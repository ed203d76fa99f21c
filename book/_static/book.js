/* What the theme leaves to do once a page is laid out: the two layers, folds, formulas, films, keyboard, buttons. */
(() => {
  "use strict";

  /* Where formulas are set in the browser: TeX breaks one in a line of text after a relation or an operator. MathJax 3 does not; it
     marks both by the space behind them. (Those that are set beforehand have their breaks: formulas/js/set.entry.js.) */
  const OPERATOR = "mjx-container:not([display]) > mjx-math > :is(mjx-mo, mjx-texatom) + :is([space='3'], [space='4'])";
  const allowBreaks = () => {
    for (const next of document.querySelectorAll(OPERATOR)) next.before(document.createElement("wbr"));
  };

  const SCROLLERS = "article :is(table, div.math mjx-container, figure):not(.inbounds-explorable *)";
  /* What a section is called, without the sign that links to it. */
  const called = (section) => [...section?.querySelector(":is(h1, h2, h3, h4, h5, h6)")?.childNodes ?? []]
    .map((part) => (part.matches?.(".headerlink") ? "" : part.textContent)).join("").trim();
  const tableName = (node) => {
    const section = node.closest("section");
    const beside = [...section?.querySelectorAll("table") ?? []]
      .filter((one) => one.closest("section") === section && !one.caption && !one.closest(".inbounds-explorable"));
    const which = beside.length > 1 ? `, ${beside.indexOf(node) + 1} of ${beside.length}` : "";
    return `Table: ${called(section) || document.title}${which}`;
  };
  const label = (node) => {
    if (node.matches("table")) return tableName(node);
    const number = node.closest("div.math")?.querySelector(".eqno")?.firstChild?.textContent ?? "";
    return node.matches("figure") ? "Figure" : `Formula ${number}`.trim();
  };

  /* A table has a name. What scrolls is a stop of the Tab key and has one, too; what does not is none. */
  const update = (node) => {
    if (node.matches("table") && !node.caption) node.setAttribute("aria-label", label(node));
    if (node.scrollWidth <= node.clientWidth) return node.removeAttribute("tabindex");
    node.tabIndex = 0;
    if (!node.matches("table")) node.setAttribute("aria-label", label(node));
    if (!node.matches("table, figure")) node.role = "group";
  };

  /* A link in the title of a fold is followed. The theme's script, which knows no links there, would open or shut some fold. */
  document.addEventListener("click", (event) => {
    if (event.target.closest?.(".admonition.toggle > .admonition-title a")) event.stopPropagation();
  }, true);

  /* What only draws is not read out: the theme's icons, and the arrows that its script puts beside folds. */
  const hush = () => {
    for (const icon of document.querySelectorAll("i[class*='fa-'], svg.tb-icon")) icon.setAttribute("aria-hidden", "true");
  };
  hush();
  addEventListener("load", hush);

  /* The theme calls each button of a fold "Toggle hidden content": it is called what it folds. */
  addEventListener("load", () => {
    for (const button of document.querySelectorAll(".admonition-title > .toggle-button")) button.ariaLabel = button.parentElement.textContent.trim();
  });

  /* Two buttons of the header show more than their labels say: "Search this book", and which mode is on. */
  document.querySelectorAll(".search-button-field").forEach((button) => button.removeAttribute("aria-label"));
  const MODES = { light: "Light", dark: "Dark", auto: "System Settings" };
  const root = document.documentElement;
  const nameMode = () => document.querySelectorAll(".theme-switch-button").forEach((button) => {
    button.ariaLabel = `Color mode: ${MODES[root.dataset.mode]}`;
  });
  new MutationObserver(nameMode).observe(root, { attributeFilter: ["data-mode"] });
  nameMode();

  /* The two layers: "read" folds the code of every cell but what stays open, "code" opens it. Pages start open, for who has no scripts. */
  const CODE = "details.inbounds-code";
  const showLayer = () => {
    const open = root.dataset.layer === "code";
    for (const fold of document.querySelectorAll(CODE)) fold.open = open || fold.matches(".stays-open");
    root.dataset.layered = "";
    document.querySelectorAll(".btn-layer-button").forEach((button) => { button.ariaPressed = String(open); });
  };
  const switchTo = (layer) => {
    /* What the reader looks at stays where it is. */
    const top = (node) => node.getBoundingClientRect().top;
    const seen = [...document.querySelectorAll("article :is(p, h1, h2, h3, li, figure, summary)")]
      .find((node) => node.checkVisibility() && top(node) > 80);
    const before = seen && top(seen);
    root.dataset.layer = layer;
    showLayer();
    if (seen) scrollBy({ top: top(seen) - before, behavior: "instant" });
  };
  window.inboundsSwitchLayer = () => {
    switchTo(root.dataset.layer === "code" ? "read" : "code");
    try { localStorage.setItem("inbounds-layer", root.dataset.layer); } catch { /* then it holds for this page */ }
  };
  /* Pages that are open beside this one follow, and so does one that opened before the choice had been written down. */
  addEventListener("storage", ({ key, newValue }) => { if (key === "inbounds-layer") switchTo(newValue ?? "read"); });
  showLayer();

  /* Paper has no folds: all of them open before printing, and close again. */
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("article details:not([open])")];
    for (const fold of opened) fold.open = true;
  });
  addEventListener("afterprint", () => { for (const fold of opened) fold.open = false; });

  /* Films that play by themselves: on one clock, while they are seen, until the reader stops one, and never for who wants less motion. */
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  for (const row of document.querySelectorAll(".inbounds-loop")) {
    const films = [...row.querySelectorAll("video")];
    if (!films.length) continue;
    let wanted = !still.matches, seen = false;
    const start = () => {
      if (wanted && seen) for (const film of films) { film.muted = true; film.play().catch(() => {}); }
    };
    const stop = () => films.forEach((film) => film.pause());
    /* A film that arrived later, or was decoded more slowly, catches up with the first one by its speed. */
    const [first, ...others] = films;
    first.addEventListener("timeupdate", () => {
      for (const film of others) {
        const behind = first.currentTime - film.currentTime;
        film.playbackRate = 1 + Math.max(-0.5, Math.min(0.5, 2 * behind));
      }
    });
    for (const film of films) {
      film.addEventListener("play", () => { film.dataset.plays = ""; });
      film.addEventListener("pause", () => { if (!film.ended) delete film.dataset.plays; });
      film.addEventListener("ended", () => {
        if (!wanted || !films.every((each) => each.ended)) return;
        for (const each of films) each.currentTime = 0;
        start();
      });
      film.addEventListener("pause", () => {
        /* At its end, or played again since: the event comes a moment later than the pause. */
        if (!film.paused || film.ended || !seen || document.hidden) return;
        wanted = false;
        stop();
      });
    }
    still.addEventListener("change", () => { wanted = !still.matches; if (wanted) start(); else stop(); });
    new IntersectionObserver((entries) => {
      seen = entries.at(-1).isIntersecting;
      if (seen) start(); else stop();
    }).observe(row);
  }

  /* A formula that is copied is its TeX: whatever is selected of it, and all of it after a double click. */
  addEventListener("dblclick", ({ target }) => {
    const formula = target.closest?.("[data-tex]");
    if (formula) getSelection().selectAllChildren(formula);
  });
  addEventListener("copy", (event) => {
    const selection = getSelection();
    if (!selection.rangeCount || selection.isCollapsed) return;
    const range = selection.getRangeAt(0).cloneRange();
    const around = (node) => (node.nodeType === Node.ELEMENT_NODE ? node : node.parentElement).closest("[data-tex]");
    const [first, last] = [around(range.startContainer), around(range.endContainer)];
    if (first) range.setStartBefore(first);
    if (last) range.setEndAfter(last);
    const copy = range.cloneContents();
    const formulas = copy.querySelectorAll("[data-tex]");
    if (!formulas.length) return;
    for (const input of copy.querySelectorAll("input")) input.removeAttribute("name"); /* a copied choice would take the reader's tick */
    for (const each of formulas) each.textContent = each.matches("div") ? `$$${each.dataset.tex}$$` : `$${each.dataset.tex}$`;
    const box = document.body.appendChild(document.createElement("div"));
    box.append(copy);
    event.clipboardData.setData("text/plain", box.innerText);
    box.remove();
    event.preventDefault();
  });

  addEventListener("load", async () => {
    if (window.MathJax) {
      await MathJax.startup?.promise;
      allowBreaks();
    }
    await document.fonts.ready;
    const scrollers = document.querySelectorAll(SCROLLERS);
    const sizes = new ResizeObserver((entries) => entries.forEach((entry) => update(entry.target)));
    scrollers.forEach((node) => sizes.observe(node));
    /* What is inside may change its width while the box around it does not. */
    addEventListener("resize", () => setTimeout(() => scrollers.forEach(update), 200));
  });
})();
