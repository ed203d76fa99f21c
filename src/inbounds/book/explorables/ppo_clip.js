// PPO's clipped surrogate of one step, min(r A, clip(r, 1 - eps, 1 + eps) A), over the ratio w, which the code calls r.
//
// Everything follows from one line: the smaller of the two is min(r A, A + eps |A|). It is flat where sign(A) (r - 1)
// has passed eps, and has the slope A everywhere else.
"use strict";

inbounds.models["ppo-clip"] = ({ ratio, advantage, clip_range }) => {
  const clip = (r) => Math.min(Math.max(r, 1 - clip_range), 1 + clip_range);
  const curves = {
    unclipped: (r) => r * advantage,
    clipped: (r) => clip(r) * advantage,
    smaller: (r) => Math.min(r * advantage, clip(r) * advantage),
  };
  const past = (r) => Math.sign(advantage) * (r - 1) > clip_range - 1e-9; // a corner counts as flat
  const inside = (r) => Math.abs(r - 1) < clip_range - 1e-9;
  const slopes = {
    unclipped: advantage,
    clipped: inside(ratio) ? advantage : 0,
    smaller: past(ratio) ? 0 : advantage,
  };

  const names = Object.keys(curves);
  const corners = [1 - clip_range, 1, 1 + clip_range];
  const x = [...Array.from({ length: 51 }, (_, i) => 0.05 * i), ...corners].sort((a, b) => a - b);
  const sources = Object.fromEntries(names.map((name) => [name, { x, y: x.map(curves[name]) }]));
  sources.here = { x: [ratio], y: [curves.smaller(ratio)] };
  const tallest = Math.max(1, 2.6 * Math.abs(advantage));
  const range = advantage >= 0 ? [-0.1 * tallest, tallest] : [-tallest, 0.1 * tallest];
  [["lower", 1 - clip_range], ["upper", 1 + clip_range]].forEach(([name, at]) => {
    sources[name] = { x: [at, at], y: range };
  });

  const number = (v) => inbounds.numerics.number(v, 2);
  const cells = (read) => names.map((name) => number(read(name)));
  const side = inside(ratio) ? 0 : Math.sign(ratio - 1); // −1: below 1 − ε, 0: inside, 1: above 1 + ε
  const atEdge = side !== 0 && Math.abs(Math.abs(ratio - 1) - clip_range) < 1e-9;
  const place = atEdge ? "stands at the end of the interval," : "has left the interval";
  const kind = advantage > 0 ? "better" : "worse";
  const wanted = Math.sign(advantage) * side;
  const note =
    advantage === 0
      ? "An advantage of zero asks for nothing: the surrogate is zero at every ratio."
      : `The action was ${kind} than expected. ` +
        {
          0: `Its ratio is inside the interval: the surrogate pushes it ${advantage > 0 ? "up" : "down"}.`,
          1: `Its ratio ${place} in the direction that was wanted: flat, nothing pushes further, and nothing pulls back.`,
          "-1": `Its ratio ${place} in the wrong direction: the clip is ignored, and the full slope leads back.`,
        }[wanted];
  return {
    sources,
    ranges: { y: range },
    table: {
      value: cells((name) => curves[name](ratio)),
      slope: cells((name) => slopes[name]),
      gain: cells((name) => curves[name](ratio) - curves[name](1)),
    },
    note,
    here: { value: curves.smaller(ratio), slope: slopes.smaller }, // for the tests
  };
};
