// Opens pages of the built book in Firefox and prints as JSON what was seen on each; test_firefox.py judges.
//
//     node read.mjs FIREFOX START PAGE...     START: address of the book, ending in a slash
//
// INBOUNDS_WINDOW=1 opens a window: without one, Firefox has WebGL only where there is a graphics card.

import puppeteer from "puppeteer-core";

const [executablePath, start, ...names] = process.argv.slice(2);
const PATIENCE = 60_000;
const WIDTHS = [1280, 360];
const AT_REST = `async () => {
  dispatchEvent(new Event("inbounds:everything"));
  await document.fonts.ready;
  const waiting = () => document.querySelector('.inbounds-explorable:is(:not([data-state]), [data-state=starting])');
  for (let i = 0; i < 300 && waiting(); i++) await new Promise((done) => setTimeout(done, 100));
}`;

// What a reader may touch (Bokeh's sliders live in shadow roots): where it is, what to do, and what it is read by before and after.
const TOUCHED = {
  explorable: [".inbounds-explorable[data-state=live]", key("pierce/[role=slider]", "ArrowRight"), ".inbounds-note, td"],
  guess: [".predict", click(".guess-check"), ".guess-result"],
  seeds: [".inbounds-picked-seeds[data-state=live]", click("input[type=checkbox]"), ".seeds-said"],
  explorer: [".inbounds-study-explorer[data-state=live]", click("input[value=trpo]"), ".explorer-said"],
  robot: [".inbounds-live-robot[data-state]", startRobot, ".inbounds-live-why, td"],
  search: ["#search-results", async () => {}, ".search-summary, li a"],
};

function key(selector, name) {
  return async (page, place) => {
    await (await place.$(selector)).focus();
    await page.keyboard.press(name);
  };
}

function click(selector) {
  return async (page, place) => {
    const target = await place.$(selector);
    await target.evaluate((node) => node.scrollIntoView({ block: "center" }));
    await target.click();
  };
}

async function startRobot(page, place) {
  const button = await place.$(".inbounds-live-ask button:not([hidden])");
  if (!button) return; // it says why
  await button.click();
  await page.waitForFunction(
    () => parseFloat(document.querySelectorAll(".inbounds-live-robot td")[2]?.textContent) > 0.2,
    { timeout: PATIENCE },
  );
}

const seen = {};
const browser = await puppeteer.launch({
  browser: "firefox", executablePath, headless: process.env.INBOUNDS_WINDOW !== "1",
  extraPrefsFirefox: { "webgl.force-enabled": true, "network.captive-portal-service.enabled": false },
});
try {
  for (const name of names) seen[name] = await read(name);
} finally {
  await browser.close();
}
console.log(JSON.stringify(seen));

// With the size puppeteer sets the orientation of the screen, a command that Firefox ESR 140 does not know.
async function resize(page, width) {
  await page.setViewport({ width, height: 800 }).catch((error) => {
    if (!/unknown command|unsupported operation/.test(error.message)) throw error;
  });
}

async function read(name) {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE);
  const found = { complaints: [], outside: [], wide: {}, touched: {} };
  page.on("console", (message) => {
    if (message.type() === "error") found.complaints.push(message.text());
  });
  page.on("pageerror", (error) => found.complaints.push(String(error)));
  page.on("request", (request) => {
    if (!request.url().startsWith(start) && !/^(data|blob|about):/.test(request.url())) found.outside.push(request.url());
  });
  for (const width of WIDTHS) {
    await resize(page, width);
    if (width === WIDTHS[0]) await page.goto(start + name, { waitUntil: "load" });
    await page.evaluate(`(${AT_REST})()`);
    found.wide[width] = await page.evaluate(
      () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
    );
  }
  await resize(page, WIDTHS[0]);
  for (const [what, [where, act, said]] of Object.entries(TOUCHED)) {
    const place = await page.$(where);
    if (!place) continue;
    const look = () => place.$$eval(said, (nodes) => nodes.map((node) => node.textContent.trim()));
    const before = await look();
    await act(page, place);
    await new Promise((done) => setTimeout(done, 500));
    found.touched[what] = { before, after: await look() };
  }
  if (await page.$("details.inbounds-code:not(.stays-open)")) {
    const open = () => page.$$eval("details.inbounds-code", (nodes) => nodes.filter((node) => node.open).length);
    const before = await open();
    await click(".btn-layer-button")(page, page);
    found.touched.layers = { before, after: await open() };
  }
  await page.close();
  return found;
}
