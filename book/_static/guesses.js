/* Predict boxes: a guess is scored, said in words, and remembered by the browser, where it may. */
(() => {
  "use strict";

  const KEY = "inbounds-guesses";
  let kept = {}, stores = true;
  const read = () => {
    if (!stores) return;
    try {
      const stored = Object.entries(JSON.parse(localStorage.getItem(KEY)) ?? {});
      kept = Object.fromEntries(stored.filter(([, one]) => typeof one?.guess === "string"));
    } catch { /* then guesses hold for this page */ }
  };
  const keep = () => {
    try { localStorage.setItem(KEY, JSON.stringify(kept)); } catch { stores = false; /* the same */ }
  };

  const NEAR = 0.5;
  const inputs = (guess) => [...guess.querySelectorAll(":is(.guess-options, .guess-number) input")];
  const field = (guess) => guess.querySelector('input[type="text"]');
  const slider = (guess) => guess.querySelector('input[type="range"]');
  const list = (letters) => [...letters].map((letter) => `(${letter})`).join(", ");

  /* What was typed as JavaScript writes it, or "" if it is no number: 0,4 is 0.4, but 3,000 is three thousand; a unit may stand behind. */
  const THOUSANDS = /^([+-]?[1-9]\d{0,2})((?:,\d{3})+)(?!\d)/;
  const number = (text) => {
    const bare = text.replace(/\s/g, "").replace(/%$/, "").replace("\u2212", "-");
    const plain = bare.replace(THOUSANDS, (_, first, more) => first + more.replaceAll(",", "")).replace(",", ".");
    return plain !== "" && Number.isFinite(Number(plain)) ? plain : "";
  };

  /* A guess as text: letters, or a number; empty while there is none. No box ticked is a guess where several may hold: the button says so. */
  const taken = (guess) => guess.dataset.kind === "number" ? number(field(guess).value)
    : inputs(guess).filter((input) => input.checked).map((input) => input.value).join("");
  const show = (guess, value) => {
    for (const input of inputs(guess)) {
      if (input.type === "text") input.value = value;
      else if (input.type === "range") input.value = value === "" ? input.defaultValue : value;
      else input.checked = value.includes(input.value);
    }
  };

  /* 1 for right, NEAR, or 0. */
  const score = (guess, value) => {
    const { kind, right, truth, within } = guess.dataset;
    if (kind === "choice") return Number(value === right);
    let far;
    if (kind === "several") {
      far = inputs(guess).filter((input) => value.includes(input.value) !== right.includes(input.value)).length;
      return far === 0 ? 1 : far === 1 ? NEAR : 0;
    }
    if (within.startsWith("x")) far = Number(value) > 0 ? Math.abs(Math.log(value / truth)) / Math.log(within.slice(1)) : Infinity;
    else far = Math.abs(value - truth) / within;
    return far <= 1 + 1e-9 ? 1 : far <= 2 + 1e-9 ? NEAR : 0;
  };

  const says = (guess, value, points) => {
    const { kind, right, shown, unit } = guess.dataset;
    const verdict = points === 1 ? "Right" : points === NEAR ? "Near" : kind === "number" ? "Off" : "Not so";
    const set = (text) => `${text}${unit ? `\u202f${unit}` : ""}`;
    if (kind === "number") return `${verdict}: you said ${set(value.replace("-", "\u2212"))}, it is ${set(shown)}.`;
    const yours = value ? `you chose ${list(value)}` : "you chose none";
    return points === 1 ? `${verdict}, ${list(value)}.` : `${verdict}: ${yours}, right ${right.length > 1 ? "are" : "is"} ${list(right)}.`;
  };

  /* The author's reasons for what was chosen, copied from the answer's fold. */
  const reasons = (guess, value) => [...value].flatMap((letter) => {
    const why = document.querySelector(`.guess-why-${guess.dataset.name}-${letter}`);
    const copy = (why?.querySelector("p") ?? why)?.cloneNode(true);
    copy?.querySelectorAll("[id]").forEach((node) => node.removeAttribute("id"));
    return copy ? [" ", ...copy.childNodes] : [];
  });

  const tell = (guess) => {
    const { guess: value, score: points } = kept[guess.dataset.name];
    const result = guess.querySelector(".guess-result");
    const verdict = document.createElement("strong");
    verdict.textContent = says(guess, value, points);
    result.dataset.score = points;
    result.replaceChildren(verdict, ...(guess.dataset.kind === "choice" ? reasons(guess, value) : []));
  };

  const boxes = [...document.querySelectorAll(".admonition.predict:has(.inbounds-guess)")];
  const guesses = (box) => [...box.querySelectorAll(".inbounds-guess")];
  const known = (box) => guesses(box).every((guess) => guess.dataset.name in kept);

  const lock = (box) => {
    const done = known(box);
    const button = box.querySelector(".guess-check");
    if (done && document.activeElement?.matches("input") && box.contains(document.activeElement)) button.focus();
    for (const guess of guesses(box)) inputs(guess).forEach((input) => { input.disabled = done; });
    button.textContent = done ? "Guess again" : "Check my guess";
  };
  const button = (text, press) => {
    const made = Object.assign(document.createElement("button"), { type: "button", textContent: text });
    made.addEventListener("click", press);
    return made;
  };
  const tally = () => {
    const points = Object.values(kept).map((one) => one.score);
    const count = (score) => points.filter((one) => one === score).length;
    const near = count(NEAR) ? `, near in ${count(NEAR)}` : "";
    for (const box of boxes) {
      const line = box.querySelector(".guess-tally");
      if (!known(box)) { line.replaceChildren(); continue; }
      const forget = button("Forget all my guesses", () => {
        const before = kept;
        kept = {};
        keep();
        boxes.forEach(clear);
        tally();
        const back = button("Bring them back", () => {
          kept = { ...before, ...kept };
          keep();
          boxes.forEach(recall);
          tally();
          box.querySelector(".guess-check").focus();
        });
        line.replaceChildren("Forgotten. ", back);
        back.focus();
      });
      line.replaceChildren(`In this book you were right in ${count(1)} of ${points.length} guesses so far${near}. `, forget);
    }
  };
  const clear = (box) => {
    for (const guess of guesses(box)) {
      delete kept[guess.dataset.name];
      show(guess, "");
      guess.querySelector(".guess-result").replaceChildren();
    }
    lock(box);
  };

  const check = (box) => {
    const again = inputs(guesses(box)[0])[0].disabled; /* as this page shows it, whatever another one has stored since */
    read();
    if (again) {
      clear(box);
      keep();
      tally();
      return;
    }
    const missing = guesses(box).filter((guess) => guess.dataset.kind !== "several" && taken(guess) === "");
    for (const guess of guesses(box)) {
      const result = guess.querySelector(".guess-result");
      delete result.dataset.score;
      const typed = guess.dataset.kind === "number" && field(guess).value.trim();
      result.textContent = !missing.includes(guess) ? "" : typed ? `Not a number: ${typed}` : "No guess yet.";
    }
    if (missing.length) { inputs(missing[0])[0].focus(); return; }
    for (const guess of guesses(box)) {
      const value = taken(guess);
      kept[guess.dataset.name] = { guess: value, score: score(guess, value) };
      tell(guess);
    }
    keep();
    lock(box);
    tally();
    const fold = box.querySelector("details");
    if (fold) fold.open = true;
  };

  /* Show what is known of a box, by today's truth, which may have changed since. */
  const recall = (box) => {
    for (const guess of guesses(box)) {
      const mine = kept[guess.dataset.name];
      if (!mine) continue;
      mine.score = score(guess, mine.guess);
      show(guess, mine.guess);
      tell(guess);
    }
    lock(box);
  };

  read();
  for (const box of boxes) {
    for (const guess of guesses(box)) {
      slider(guess)?.addEventListener("input", () => { field(guess).value = slider(guess).value; });
      if (slider(guess)) field(guess).addEventListener("input", () => { slider(guess).value = number(field(guess).value); });
      field(guess)?.addEventListener("keydown", (event) => {
        if (event.key !== "Enter") return;
        event.preventDefault(); /* or it would press the button that has the focus by then */
        check(box);
      });
    }
    recall(box);
    box.querySelector(".guess-check").addEventListener("click", (event) => { if (event.detail < 2) check(box); }); /* a double click is one */
  }
  tally();
})();
