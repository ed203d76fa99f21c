// A few lines for making the page's controls.
"use strict";

inbounds.live.dom = (() => {
  // An element with properties, attributes (names with a dash, and role) and children.
  function make(tag, properties = {}, ...children) {
    const node = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
      if (name === "role" || name.includes("-")) node.setAttribute(name, value);
      else node[name] = value;
    }
    node.append(...children);
    return node;
  }

  // A labelled choice; `options` maps values to texts.
  function choice(label, options, chosen, onChange) {
    const select = make("select", { "aria-label": label });
    const fill = (entries, value) => {
      select.replaceChildren(...Object.entries(entries).map(([key, text]) => make("option", { value: key }, text)));
      select.value = value in entries ? value : Object.keys(entries)[0];
    };
    fill(options, chosen);
    select.addEventListener("change", () => onChange(select.value));
    return { node: make("label", {}, make("span", {}, label), select), select, fill };
  }

  // A labelled slider that shows its value.
  function slider(label, { min, max, step, value, text }, onInput) {
    const shown = make("span", { className: "inbounds-live-value" }, text(value));
    const input = make("input", { type: "range", min, max, step, value, "aria-label": label });
    input.addEventListener("input", () => {
      shown.textContent = text(Number(input.value));
      input.setAttribute("aria-valuetext", shown.textContent);
      onInput(Number(input.value));
    });
    return { node: make("label", {}, make("span", {}, `${label} `, shown), input), input };
  }

  const button = (text, onClick) => {
    const node = make("button", { type: "button" }, text);
    node.addEventListener("click", onClick);
    return node;
  };

  return { make, choice, slider, button };
})();
