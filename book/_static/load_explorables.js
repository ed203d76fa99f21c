/* BokehJS and the scripts of the explorables, a megabyte, come when the reader comes near an explorable. Until then, and on paper, it is a figure.
   Whoever wants a page with all that may come to it, such as a test, says so: dispatchEvent(new Event("inbounds:everything")). */
(() => {
  "use strict";
  const scripts = JSON.parse(document.currentScript.dataset.scripts);
  const explorables = document.querySelectorAll(".inbounds-explorable");
  const NEAR = "1200px 0px"; /* a screen and a half, so that it stands when it is seen */

  /* What cannot be loaded leaves the figure, and no room below it. */
  const onerror = () => { for (const each of explorables) each.dataset.state ??= "static"; };
  let asked = false;
  const load = () => {
    if (asked) return;
    asked = true;
    near.disconnect();
    for (const src of scripts) document.head.append(Object.assign(document.createElement("script"), { src, onerror, async: false }));
  };
  const near = new IntersectionObserver((seen) => { if (seen.some((each) => each.isIntersecting)) load(); }, { rootMargin: NEAR });
  for (const each of explorables) near.observe(each);

  /* The next stop of the Tab key may be a slider that is not there yet. */
  addEventListener("keydown", ({ key }) => { if (key === "Tab") load(); });
  addEventListener("inbounds:everything", load);
})();
