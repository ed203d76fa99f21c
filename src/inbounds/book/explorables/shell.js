// What every explorable needs around its mathematics: render with BokehJS, answer the controls, follow the page's
// theme, speak to a screen reader. Without BokehJS the static figure stays, and nothing is logged.
"use strict";

(() => {
  const places = new WeakMap(); // Bokeh document -> the element it is shown in, its pictures, and where its sliders stood at first
  const MOVED = "As the sliders are now; the table and the text below say what it shows.";

  const bokeh = (version) => globalThis.Bokeh?.[version] ?? globalThis.Bokeh;
  const all = (doc, type) => [...doc.all_models].filter((model) => model.type === type);
  const named = (doc, type, name) => all(doc, type).find((model) => model.name === name);

  // The controls changed: compute what the page shows, and show it. Called by the CustomJS of every control.
  inbounds.refresh = (doc) => {
    if (!places.has(doc)) return;
    const { container, pictures, starts } = places.get(doc);
    const controls = all(doc, "Slider");
    const state = inbounds.models[container.dataset.model](
      Object.fromEntries(controls.map((slider) => [slider.name, slider.value])),
    );
    for (const [name, data] of Object.entries(state.sources)) named(doc, "ColumnDataSource", name).data = data;
    for (const [name, [start, end]] of Object.entries(state.ranges)) named(doc, "Range1d", name).setv({ start, end });
    for (const row of container.querySelectorAll("tr[data-row]")) {
      state.table[row.dataset.row].forEach((text, i) => (row.cells[i + 1].textContent = text));
    }
    container.querySelector(".inbounds-note").textContent = state.note;
    const moved = controls.some((slider, i) => slider.value !== starts[i]);
    container.querySelector(".inbounds-back").setAttribute("aria-disabled", String(!moved));
    const shown = moved ? `${container.getAttribute("aria-label")}. ${MOVED}` : container.dataset.alt;
    for (const picture of pictures) picture.setAttribute("aria-label", shown);
  };

  const isDark = () => {
    const { theme } = document.documentElement.dataset; // the book
    if (theme) return theme === "dark";
    const { jpThemeLight } = document.body.dataset; // JupyterLab
    if (jpThemeLight) return jpThemeLight === "false";
    return document.body.classList.contains("vscode-dark");
  };

  // Bokeh draws on a canvas, which style sheets do not reach: hand it the colours that the style sheet gives here.
  function paint(container, doc) {
    container.dataset.theme = isDark() ? "dark" : "light";
    const style = getComputedStyle(container);
    const color = (name) => style.getPropertyValue(`--inbounds-${name}`).trim();
    const font = style.fontFamily;
    container.style.setProperty("--bokeh-base-font", font);
    for (const axis of all(doc, "LinearAxis")) {
      axis.setv({
        axis_label_text_font: font, major_label_text_font: font,
        axis_label_text_color: color("ink"), major_label_text_color: color("ink"),
        axis_line_color: color("line"), major_tick_line_color: color("line"), minor_tick_line_color: null,
      });
    }
    for (const grid of all(doc, "Grid")) grid.grid_line_color = color("grid");
    for (const span of all(doc, "Span")) span.line_color = color("line");
    for (const { name, glyph } of all(doc, "GlyphRenderer")) {
      if (glyph.type === "Text") glyph.setv({ text_color: { value: color("ink") }, text_font: { value: font } });
      else glyph.line_color = { value: color(name) };
      if (["VBar", "Patch"].includes(glyph.type)) glyph.setv({ fill_color: { value: color(name) }, hatch_color: { value: color(name) } });
    }
  }

  // noUiSlider's handle can be reached by Tab and moved by arrow keys, but has no name, and speaks the raw value.
  function label(slider, view) {
    const shadow = view.el.shadowRoot;
    const handle = shadow.querySelector(".noUi-handle");
    handle.setAttribute("aria-label", slider.title);
    const speak = () => {
      const text = shadow.querySelector(".bk-slider-value")?.textContent;
      if (text && handle.getAttribute("aria-valuetext") !== text) handle.setAttribute("aria-valuetext", text);
    };
    new MutationObserver(speak).observe(handle, { attributeFilter: ["aria-valuetext"] });
    slider.properties.value.change.connect(speak);
    speak();
  }

  async function start(container) {
    const item = JSON.parse(container.querySelector("script[type='application/json']").textContent);
    const api = bokeh(item.version);
    if (!api?.Models?.get || !inbounds.models[container.dataset.model]) {
      container.dataset.state = "static";
      return;
    }
    container.dataset.state = "starting";
    const live = container.querySelector(".inbounds-live");
    const views = await api.embed.embed_item(item, live.querySelector(".inbounds-plot"));
    const [root] = views.roots;
    const doc = root.model.document;
    const sliders = all(doc, "Slider");
    const pictures = all(doc, "Figure").map((plot) => views.find_one(plot));
    const starts = sliders.map(({ value }) => value);
    const back = Object.assign(document.createElement("button"), {
      type: "button", className: "inbounds-back", textContent: "Back to the start",
      onclick: () => sliders.forEach((slider, i) => (slider.value = starts[i])),
    });
    live.append(back);
    places.set(doc, { container, pictures: pictures.map(({ el }) => el), starts });
    paint(container, doc);
    inbounds.refresh(doc);
    for (const slider of sliders) label(slider, views.find_one(slider));
    for (const { el, canvas_view } of pictures) {
      canvas_view.events_el.removeAttribute("tabindex"); // the sliders answer the keyboard; the picture does not
      el.setAttribute("role", "img");
    }
    const follow = new MutationObserver(() => paint(container, doc));
    follow.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    follow.observe(document.body, { attributeFilter: ["data-jp-theme-light", "class"] });
    container.dataset.state = "live";
  }

  // Start every explorable that stands in the page and has not been started.
  inbounds.boot = () => {
    for (const container of document.querySelectorAll(".inbounds-explorable:not([data-state])")) {
      start(container).catch((error) => {
        container.dataset.state = "static";
        console.error(error);
      });
    }
  };

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", inbounds.boot);
  else inbounds.boot();
})();
