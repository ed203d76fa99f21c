/* Sets formulas: JSON on standard input, JSON on standard output. Bundled once by esbuild, run once for all pages. */
import { readFileSync } from "node:fs";
import { AssistiveMmlHandler } from "mathjax-full/js/a11y/assistive-mml.js";
import { liteAdaptor } from "mathjax-full/js/adaptors/liteAdaptor.js";
import { RegisterHTMLHandler } from "mathjax-full/js/handlers/html.js";
import { TeX } from "mathjax-full/js/input/tex.js";
import "mathjax-full/js/input/tex/ams/AmsConfiguration.js";
import "mathjax-full/js/input/tex/base/BaseConfiguration.js";
import "mathjax-full/js/input/tex/boldsymbol/BoldsymbolConfiguration.js";
import "mathjax-full/js/input/tex/cancel/CancelConfiguration.js";
import "mathjax-full/js/input/tex/color/ColorConfiguration.js";
import "mathjax-full/js/input/tex/configmacros/ConfigMacrosConfiguration.js";
import "mathjax-full/js/input/tex/newcommand/NewcommandConfiguration.js";
import { mathjax } from "mathjax-full/js/mathjax.js";
import { CHTML } from "mathjax-full/js/output/chtml.js";

const { formulas, macros, fonts } = JSON.parse(readFileSync(0, "utf8"));
const adaptor = liteAdaptor();
AssistiveMmlHandler(RegisterHTMLHandler(adaptor));
const input = new TeX({
  packages: ["base", "ams", "boldsymbol", "cancel", "color", "configmacros", "newcommand"],
  macros,
  formatError(_, error) { throw error; },
});
const output = new CHTML({ fontURL: fonts, adaptiveCSS: false });
const page = mathjax.document("", { InputJax: input, OutputJax: output });

/* TeX breaks a formula in a line of text after a relation or an operator. MathJax 3 does not; it marks both by the space behind them. */
const OPERATORS = ["mjx-mo", "mjx-texatom"];
const SPACES = ["3", "4"];
const allowBreaks = (container) => {
  const parts = [...adaptor.childNodes(adaptor.firstChild(container))];
  parts.forEach((part, i) => {
    if (i > 0 && OPERATORS.includes(adaptor.kind(parts[i - 1])) && SPACES.includes(adaptor.getAttribute(part, "space"))) {
      adaptor.insert(adaptor.node("wbr"), part);
    }
  });
};

const set = ({ tex, display }) => {
  try {
    /* Sizes are in em; formulas.css takes the em from the text around, whose font is known only to the reader's browser. */
    const container = page.convert(tex, { display });
    adaptor.removeAttribute(container, "style");
    if (!display) allowBreaks(container);
    return { html: adaptor.outerHTML(container) };
  } catch (error) {
    return { error: error.message };
  }
};

process.stdout.write(JSON.stringify({ set: formulas.map(set), css: adaptor.textContent(output.styleSheet(page)) }));
