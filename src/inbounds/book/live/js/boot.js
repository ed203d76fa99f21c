// Stands on every page that has a live robot, and is all that such a page loads until the reader asks for it. Then it
// fetches the rest by classic scripts from the folder it lies in: modules and fetch() do not work from file://.
"use strict";

globalThis.inbounds ??= {};
inbounds.live ??= {};

(() => {
  const { live } = inbounds;
  const folder = new URL(".", document.currentScript.src).href;
  const loading = new Map();
  Object.assign(live, { folder, robots: {}, policies: {}, starts: {} });

  // Run one of the folder's scripts, once a page.
  live.load = (path) => {
    if (!loading.has(path)) {
      const script = document.createElement("script");
      loading.set(path, new Promise((done, failed) => {
        script.onload = done;
        script.onerror = () => {
          loading.delete(path);
          failed(new Error(`${path} could not be loaded`));
        };
      }));
      document.head.append(Object.assign(script, { src: folder + path, async: false }));
    }
    return loading.get(path);
  };

  // What this browser lacks, in words, or nothing.
  function lacks() {
    if (typeof WebAssembly !== "object") return "WebAssembly";
    if (typeof DecompressionStream !== "function") return "DecompressionStream";
    const context = document.createElement("canvas").getContext("webgl2");
    if (!context) return "WebGL 2";
    context.getExtension("WEBGL_lose_context")?.loseContext();
    return "";
  }

  // MuJoCo, started once a page.
  live.start = () => {
    live.started ??= (async () => {
      for (const part of live.status.parts) await live.load(part); // as the build has listed them
      const wasmBinary = new Uint8Array(await live.unpack(live.wasm));
      const mujoco = await live.engine.load({ wasmBinary, print: console.debug, printErr: console.debug });
      delete live.wasm;
      return mujoco;
    })();
    live.started.catch(() => delete live.started); // so that the reader can try again
    return live.started;
  };

  async function ask(element, button, says) {
    if (element.dataset.state === "loading") return;
    element.dataset.state = "loading";
    button.setAttribute("aria-disabled", "true");
    says.textContent = "Loading MuJoCo and the policies …";
    try {
      const mujoco = await live.start();
      const show = new live.Show(element, mujoco);
      await show.open();
      says.textContent = "";
      if (document.activeElement === button) show.play.focus();
      button.hidden = true;
      element.dataset.state = "live";
    } catch (error) {
      element.dataset.state = "film";
      button.removeAttribute("aria-disabled");
      says.textContent = `The robots could not be started here (${error.message}); the film stays.`;
    }
  }

  live.boot = () => {
    for (const element of document.querySelectorAll(".inbounds-live-robot:not([data-state])")) {
      const button = element.querySelector(".inbounds-live-ask button");
      const says = element.querySelector(".inbounds-live-why");
      element.dataset.state = "film";
      const why = live.status?.why;
      const lacking = why ? "" : lacks();
      if (why || lacking) {
        says.textContent = why || `This browser has no ${lacking}, which the live robot needs; the film stays.`;
        continue;
      }
      says.textContent = live.status?.size ?? "";
      button.hidden = false;
      button.addEventListener("click", () => ask(element, button, says));
    }
  };

  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", live.boot);
  else live.boot();
})();
