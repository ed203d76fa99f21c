// What the study's elements share: nodes made in one line, a drawing as wide as its room, a start once the page is read.
"use strict";

globalThis.inbounds = globalThis.inbounds ?? {};

inbounds.page = (() => {
  const given = (node, attributes, children) => {
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.append(...children);
    return node;
  };
  const make = (name, attributes = {}, ...children) => given(document.createElement(name), attributes, children);
  const draw = (name, attributes = {}, ...children) =>
    given(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
  const color = (name) => `var(--explorer-${name})`; // as the style sheet has it in either theme

  // Calls draw(width) whenever the width of `room` has changed, which it has once it is shown.
  function followWidth(room, drawing) {
    let width = 0;
    new ResizeObserver(() => {
      if (!room.clientWidth || room.clientWidth === width) return;
      width = room.clientWidth;
      drawing(width);
    }).observe(room);
  }

  // Starts every element of a class that has not been started; in node, where only arithmetic is wanted, none.
  function startAll(name, start) {
    if (!globalThis.document) return;
    const boot = () => document.querySelectorAll(`.${name}:not([data-state])`).forEach((each) => start(each));
    if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", boot);
    else boot();
  }

  return { make, draw, color, followWidth, startAll };
})();
