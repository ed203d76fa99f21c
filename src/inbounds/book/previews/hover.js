/* What a link leads to, beside it, for a resting pointer or the keyboard's focus. */
(() => {
  "use strict";
  globalThis.inbounds ??= {};
  const home = new URL(".", document.currentScript.src).href;
  const root = new URL("../../", home).href;
  const known = new Map(), waiting = new Map();
  const LINKS = "article a.reference.internal[href*='#']";
  const GAP = 6, EDGE = 8, LEAST = 120, REST = 250;
  let box, shown, timer;

  inbounds.previews = { come: (page, texts) => known.set(page, texts) };

  /* A script, not fetch: from file:// nothing else may be read. A page without previews has none. */
  const load = (page) => {
    if (!waiting.has(page)) {
      waiting.set(page, new Promise((done) => {
        const script = document.createElement("script");
        script.onload = script.onerror = done;
        script.src = `${home}${page.replaceAll("/", ".")}.js`;
        document.head.append(script);
      }));
    }
    return waiting.get(page);
  };
  const parts = (link) => {
    const [page, id] = link.href.split("#");
    return page.startsWith(root) ? [decodeURI(page.slice(root.length)), decodeURIComponent(id)] : [];
  };
  const MAYBE = /^(term-|id\d|equation-|def-|thm-|lem-|prop-|cor-|rem-|alg-|cnj-|obs-|ax-)/;

  const close = () => {
    clearTimeout(timer);
    shown?.removeAttribute("aria-describedby");
    shown = undefined;
    if (box) box.hidden = true;
  };
  const later = (act, wait) => { clearTimeout(timer); timer = setTimeout(act, wait); };

  /* Below the link, or above it where there is more room; never over it. */
  const place = (link) => {
    const around = link.getBoundingClientRect();
    const below = innerHeight - around.bottom - GAP - EDGE, above = around.top - GAP - EDGE;
    const width = document.documentElement.clientWidth;
    box.style.maxHeight = "none";
    const under = box.offsetHeight <= below || below >= above;
    box.style.maxHeight = `${Math.max(under ? below : above, LEAST)}px`;
    box.style.left = `${Math.max(EDGE, Math.min(around.left, width - box.offsetWidth - EDGE))}px`;
    box.style.top = under ? `${around.bottom + GAP}px` : `${around.top - GAP - box.offsetHeight}px`;
  };
  const open = async (link) => {
    if (link !== shown) close(); /* whether or not this link has something to show */
    const [page, id] = parts(link);
    if (!page || !MAYBE.test(id)) return;
    await load(page);
    const text = known.get(page)?.[id];
    if (!text || !(link.matches(":hover") || link === document.activeElement)) return;
    close();
    if (!box) {
      box = document.createElement("div");
      box.id = "inbounds-preview";
      box.role = "tooltip";
      box.className = "bd-article inbounds-preview";
      box.addEventListener("pointerenter", () => clearTimeout(timer));
      box.addEventListener("pointerleave", () => later(close, REST));
      document.body.append(box);
    }
    box.innerHTML = text;
    box.hidden = false;
    box.scrollTop = 0;
    shown = link;
    link.setAttribute("aria-describedby", box.id);
    place(link);
  };

  document.addEventListener("pointerover", (event) => {
    const link = event.target.closest?.(LINKS);
    if (link && link !== shown && event.pointerType === "mouse") later(() => open(link), REST);
    else if (link) clearTimeout(timer);
  });
  document.addEventListener("pointerout", (event) => {
    if (event.target.closest?.(LINKS)) later(close, REST);
  });
  document.addEventListener("focusin", ({ target }) => {
    if (target.matches?.(LINKS) && target.matches(":focus-visible")) open(target);
  });
  document.addEventListener("focusout", ({ target }) => { if (target === shown) close(); });
  document.addEventListener("keydown", ({ key }) => { if (key === "Escape") close(); });
  addEventListener("scroll", (event) => { if (shown && event.target !== box) place(shown); }, { capture: true, passive: true });
})();
