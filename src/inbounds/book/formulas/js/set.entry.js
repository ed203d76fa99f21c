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

/* TeX breaks a formula in a line of text after a relation or an operator. MathJax 3 does not; it marks both by the space before what
   follows, which moves behind the operator here, lest a new line begin with it. A short formula stays whole, and so does what stands
   in brackets, except on a phone (book.css). */
const SPACES = ["3", "4"];
const SHORT = 8;
const OPENING = ["28", "5B", "7B"];
const CLOSING = ["29", "5D", "7D"];
const bracket = (part) => {
  /* A large bracket, such as \big(, stands in an atom of its own. */
  if (adaptor.kind(part) === "mjx-TeXAtom") {
    const inner = adaptor.childNodes(part);
    return inner.length === 1 ? bracket(inner[0]) : 0;
  }
  /* Of a bracket with an exponent the bracket comes first. */
  if (["mjx-msup", "mjx-msub", "mjx-msubsup"].includes(adaptor.kind(part))) return bracket(adaptor.firstChild(part));
  const character = adaptor.kind(part) === "mjx-mo" && adaptor.firstChild(part);
  const code = character && (adaptor.getAttribute(character, "class") ?? "").match(/mjx-c([0-9A-F]+)/)?.[1];
  return OPENING.includes(code) ? 1 : CLOSING.includes(code) ? -1 : 0;
};
const allowBreaks = (container) => {
  const parts = [...adaptor.childNodes(adaptor.firstChild(container))];
  const spaces = parts.map((part) => adaptor.getAttribute(part, "space"));
  const isOperator = (i) => adaptor.kind(parts[i]) === "mjx-mo" && (i === 0 || SPACES.includes(spaces[i]));
  let depth = 0;
  parts.forEach((part, i) => {
    if (i > 0 && isOperator(i - 1) && SPACES.includes(spaces[i])) {
      adaptor.removeAttribute(part, "space");
      adaptor.setAttribute(parts[i - 1], "data-behind", spaces[i]);
      adaptor.insert(adaptor.node("wbr", depth > 0 || parts.length <= SHORT ? { class: "on-a-phone" } : {}), part);
    }
    depth = Math.max(0, depth + bracket(part));
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
