// Lighthouse on pages of a built book, as a phone on a slow network would load them: node measure.mjs BROWSER FOLDER RUNS PAGE ...
// Prints a line of JSON for each run. The folder is served compressed, as the usual hosts of static pages do.
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join } from "node:path";
import { gzipSync } from "node:zlib";
import lighthouse from "lighthouse";
import puppeteer from "puppeteer-core";

const TYPES = {
  ".html": "text/html; charset=utf-8", ".css": "text/css", ".js": "text/javascript", ".json": "application/json",
  ".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg", ".mp4": "video/mp4", ".woff": "font/woff", ".woff2": "font/woff2",
};
const COMPRESSED = new Set([".html", ".css", ".js", ".json", ".svg"]);

const [browser, folder, runs, ...pages] = process.argv.slice(2);
const server = createServer(async ({ url }, answer) => {
  const path = decodeURIComponent(new URL(url, "http://127.0.0.1").pathname);
  const ending = extname(path);
  try {
    const content = await readFile(join(folder, path)); // a URL's path has no ".." left
    const headers = { "Content-Type": TYPES[ending] ?? "application/octet-stream", "Cache-Control": "max-age=600" };
    if (COMPRESSED.has(ending)) headers["Content-Encoding"] = "gzip";
    answer.writeHead(200, headers).end(COMPRESSED.has(ending) ? gzipSync(content) : content);
  } catch {
    answer.writeHead(404).end();
  }
});
await new Promise((done) => server.listen(0, "127.0.0.1", done));

for (let run = 0; run < Number(runs); run++) {
  for (const page of pages) {
    const opened = await puppeteer.launch({
      executablePath: browser,
      args: ["--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"],
    });
    try {
      const address = `http://127.0.0.1:${server.address().port}/${page}`;
      const { lhr } = await lighthouse(address, {
        port: Number(new URL(opened.wsEndpoint()).port), onlyCategories: ["performance"], logLevel: "error",
      });
      if (lhr.runtimeError) throw new Error(`${page}: ${lhr.runtimeError.message}`);
      const value = (name) => lhr.audits[name].numericValue;
      console.log(JSON.stringify({
        page,
        score: Math.round(100 * lhr.categories.performance.score),
        seen: value("first-contentful-paint") / 1000,
        largest: value("largest-contentful-paint") / 1000,
        blocked: value("total-blocking-time") / 1000,
        shift: value("cumulative-layout-shift"),
        kilobytes: value("total-byte-weight") / 1000,
      }));
    } finally {
      await opened.close();
    }
  }
}
server.close();
