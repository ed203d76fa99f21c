// Claims with verdicts: buttons choose which verdicts are shown, a menu which subject; what is left is counted, in words.
// None pressed but "All" is all. Nothing is computed here: lines are hidden, and counted.
"use strict";

(() => {
  function start(box) {
    box.dataset.state = "live";
    const lines = [...box.querySelectorAll("details[data-verdict]")];
    const buttons = [...box.querySelectorAll("button[data-verdict]")];
    const menu = box.querySelector("select");
    const again = box.querySelector(".claims-all"); // the way out of a choice that nothing answers to
    const chosen = new Set();

    function show() {
      if (!menu) return; // few claims: nothing to choose
      const of = (line) => !menu.value || line.parentElement.dataset.subject === menu.value;
      const wanted = (line) => of(line) && (!chosen.size || chosen.has(line.dataset.verdict));
      for (const line of lines) line.hidden = !wanted(line);
      for (const part of box.querySelectorAll(".claims-subject")) part.hidden = ![...part.querySelectorAll("details")].some(wanted);
      for (const button of buttons) {
        const { verdict } = button.dataset;
        button.ariaPressed = String(verdict ? chosen.has(verdict) : !chosen.size);
        button.lastElementChild.textContent = lines.filter((line) => of(line) && (!verdict || line.dataset.verdict === verdict)).length;
      }
      const told = [[...chosen].join(", "), menu.value].filter(Boolean).join("; ");
      again.hidden = lines.some(wanted);
      box.querySelector("[role=status]").textContent = `${lines.filter(wanted).length} of ${lines.length} claims${told ? `: ${told}` : ""}.`;
    }

    function all() {
      chosen.clear();
      if (menu) menu.value = "";
      show();
    }

    for (const button of buttons) {
      button.addEventListener("click", () => {
        const { verdict } = button.dataset;
        if (!verdict) chosen.clear();
        else if (!chosen.delete(verdict)) chosen.add(verdict);
        show();
      });
    }
    menu?.addEventListener("change", show);
    again?.addEventListener("click", () => {
      all();
      buttons[0].focus();
    });

    // A link to a claim opens it, whatever is chosen.
    const follow = () => {
      const line = lines.find(({ id }) => `#${encodeURIComponent(id)}` === location.hash || `#${id}` === location.hash);
      if (!line) return;
      all();
      line.open = true;
      line.scrollIntoView();
    };
    addEventListener("hashchange", follow);
    follow();
  }

  inbounds.page.startAll("inbounds-claims", start);
})();
