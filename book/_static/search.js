/* Search that knows the book. Sphinx says which pages have a query's words; this puts them in order and shows a passage of each. Pages of
   `window.inboundsPages` (book/_ext/search_pages.py): [address, title, kind, phrases, [[anchor, heading, passage], ...]]. Nothing is fetched, so
   that it works from the disk, too. */
(() => {
  "use strict";

  /* Words that a question has and an answer has not. */
  const EMPTY = new Set("a an and are be do does for how i in is it of on or should the there to use what with".split(" "));
  const words = (text) => text.toLowerCase().normalize("NFKD").split(/[^\p{Letter}\p{Number}]+/u).filter((word) => word);
  const inflected = (word) => word.replace(/(?<=[a-z]{3})(ies|es|s|ing|ed|ion|ions)$/, (end) => (end.startsWith("ies") ? "y" : ""));
  const terms = (text) => {
    const all = words(text).map(inflected);
    const telling = all.filter((word) => !EMPTY.has(word));
    return telling.length ? telling : all;
  };
  const same = (a, b) => a.length === b.length && a.every((word, i) => word === b[i]);
  const share = (asked, text) => {
    const there = new Set(terms(text));
    const starts = (word) => {
      const stem = word.length < 8 ? word : word.slice(0, -2);
      return word.length > 3 && [...there].some((other) => other.startsWith(stem));
    };
    return asked.filter((word) => there.has(word) || starts(word)).length / asked.length;
  };

  const KINDS = { core: 3, depth: 1.5 };

  /* What a page is worth for a query: a phrase it is known by, then its title, its headings, and last that Sphinx found the words in it. */
  const score = (asked, [, title, kind, phrases, sections], found) => {
    const named = same(asked, terms(title));
    const sought = phrases.some((phrase) => same(asked, terms(phrase)));
    const known = Math.max(0, ...phrases.map((phrase) => share(asked, phrase)));
    const headings = Math.max(0, ...sections.map(([, heading]) => share(asked, heading)));
    const said = Math.max(0, ...sections.map(([, , passage]) => share(asked, passage)));
    const points = (sought ? 150 : 0) + (named ? 100 : 0) + 25 * known ** 2 + 30 * share(asked, title) ** 2 + 15 * headings ** 2 + 4 * said ** 2
      + (found ? 12 : 0);
    /* One word of many that stands in some heading is no answer. */
    return found || named || sought || known === 1 || share(asked, title) === 1 || headings === 1 ? points + (KINDS[kind] ?? 0) : 0;
  };

  const bestSection = (asked, [, title, , , sections]) => {
    const worth = ([, heading, passage], i) => 3 * share(asked, heading) + share(asked, passage) - i / 1e3;
    const [first] = sections;
    const best = sections.map((section, i) => [worth(section, i), section]).sort(([a], [b]) => b - a)[0]?.[1];
    return share(asked, title) === 1 && first?.[2] ? first : best;
  };

  /* The pages for a query, best first, each with the section that fits best. `found` holds the addresses that Sphinx found. */
  const rank = (query, pages, found = new Set()) => {
    const asked = terms(query);
    return asked.length === 0 ? [] : pages
      .map((page) => ({ page, points: score(asked, page, found.has(page[0])) }))
      .filter(({ points }) => points > 0)
      .sort((a, b) => b.points - a.points)
      .map(({ page }) => ({ address: page[0], title: page[1], kind: page[2], section: bestSection(asked, page) }));
  };

  if (typeof module !== "undefined") module.exports = { rank };
  if (typeof Search === "undefined" || !window.inboundsPages) return;

  const LABELS = { core: "Core chapter", depth: "Going deeper" };
  const add = (parent, tag, text, className = "") => {
    const node = parent.appendChild(document.createElement(tag));
    node.textContent = text;
    if (className) node.className = className;
    return node;
  };
  const mark = (parent, text, asked) => {
    for (const part of text.split(/([\p{Letter}\p{Number}]+)/u)) {
      const hit = /[\p{Letter}\p{Number}]/u.test(part) && asked.includes(inflected(part.toLowerCase()));
      if (hit) add(parent, "mark", part); else parent.append(part);
    }
  };

  const showPage = (list, { address, title, kind, section }, asked) => {
    const item = add(list, "li", "");
    const heading = section?.[1] && section[1] !== title ? section : null;
    add(item, "a", title).href = `${address}.html`;
    if (LABELS[kind]) add(item, "span", LABELS[kind], "kind");
    if (heading) {
      item.append(" · ");
      add(item, "a", heading[1]).href = `${address}.html#${heading[0]}`;
    }
    if (section?.[2]) mark(add(item, "p", "", "context"), section[2], asked);
  };

  const MOST = 25;
  Search.query = (query) => {
    const [, searchTerms, excluded, , objectTerms] = Search._parseQuery(query);
    const results = Search.performTermsSearch(searchTerms, excluded);
    const objects = [...objectTerms].flatMap((term) => Search.performObjectSearch(term, objectTerms))
      .filter((result) => result[0] === "book/api").sort((a, b) => b[4] - a[4]);
    const found = new Set(results.map(([name]) => name));
    const asked = query.replace(/(^|\s)-\S+/g, " ");
    const pages = rank(asked, window.inboundsPages, found).filter(({ address }) => !excluded.size || found.has(address)).slice(0, MOST);
    const names = [...new Map(objects.map((each) => [each[1], each])).values()].slice(0, 10);
    /* A name of the package, written as one, is what was asked for. */
    const asName = /[._]/.test(query);
    const list = Search.output;
    document.getElementById("search-progress")?.replaceChildren();
    const showNames = () => names.forEach(([name, fullname, anchor, about]) => {
      const item = add(list, "li", "");
      add(item, "a", fullname).href = `${name}.html${anchor}`;
      add(item, "span", about, "kind");
    });
    if (asName) showNames();
    pages.forEach((page) => showPage(list, page, terms(asked)));
    if (!asName) showNames();
    Search.stopPulse();
    Search.title.textContent = "Results";
    const count = list.childElementCount;
    Search.status.setAttribute("role", "status"); /* before it says something */
    Search.status.textContent = count ? `${count} ${count === 1 ? "place" : "places"} for “${query}”`
      : `Nothing in the book has the words “${query}”. Fewer words find more.`;
  };
})();
