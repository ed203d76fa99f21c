// A greenhouse that the reader runs by a rule, beside the chapter's rule and a policy that has learned.
//
// The equations are those of src/inbounds/book/own_task/greenhouse.py, in double precision. What a rule sees, and what it
// does, is single precision there, and so it is here: Math.fround stands where Python rounds.
"use strict";

inbounds.greenhouse = (() => {
  const [QUARTERS, COLD, HOT] = [96, 5, 35];
  const { fround } = Math;

  // First temperature [°C], season [°C] and sky of the forty days for choosing, seeds 5000 to 5039; which three are shown;
  // what the planner earns on these; the means over all forty.
  const DAYS = [
    [10.830194782861101, 4.265680732617838, 0.8430657339469192], [13.47272400670385, 9.256493631452916, 0.25250410301850074],
    [16.773608176876046, 9.197958843661436, 0.40836369452959353], [15.903882665774233, 1.5537926777271687, 0.6030534306047054],
    [11.255039237443627, 5.709158095545689, 0.32530532933849465], [13.405991577843203, 6.374430341487171, 0.40633920555240116],
    [22.934048431665616, 5.368459357348828, 0.5949471911448341], [23.74525939417105, 0.009299271098920148, 0.29267616749537684],
    [18.2798306728043, 2.34046826209636, 0.7960994458220649], [13.655017182685548, 8.068075123448294, 0.6994724242019423],
    [15.750614086573874, 0.1546693278216491, 0.7935386536059896], [18.11023482502002, 3.9866730046559185, 0.603702198242376],
    [23.10165426670677, 11.796439951631411, 0.4045570278216743], [21.687262700633994, 8.897059413419054, 0.42932004636003723],
    [19.365174497151735, 9.238213673858883, 0.7215646946217653], [14.624156130966577, 0.3887574244530332, 0.38912967059593556],
    [21.227513706628493, 11.473489432537887, 0.4186853069467247], [10.519958451798017, 9.941049105503268, 0.6598812263752987],
    [15.562337319635994, 4.559880291762319, 0.8764860057431463], [22.689943676809186, 2.2499529859975955, 0.41201035080184756],
    [18.11695902321143, 0.7448474038469031, 0.89661742798812], [17.2529979784685, 6.420313037273973, 0.38000524151827375],
    [18.724529850817973, 4.488611615665, 0.4657759557273785], [23.844584302967114, 3.5132239346924514, 0.23260914870975818],
    [21.09185439311853, 3.328149758774167, 0.45471422939181816], [23.126749152710623, 8.196313105926894, 0.954534225168518],
    [19.809761693506665, 0.7874989100381145, 0.9559970543780878], [15.928080481124258, 5.284278092218168, 0.2641368877561558],
    [22.07413094481067, 10.004785458098748, 0.8869896236086248], [14.595677502852865, 5.882049364318554, 0.5202472596581906],
    [14.30585424075456, 0.07923806658267063, 0.7961569897085645], [15.452915860436802, 10.625659314805981, 0.839086305603465],
    [20.34419703625756, 5.426118157976666, 0.5137032472631915], [14.997096849831483, 11.508392128500468, 0.28219913904294336],
    [16.03746609303739, 1.996500885179481, 0.9779954746010202], [18.67017107326656, 6.597699997159474, 0.21719812730311228],
    [19.76866679809975, 10.944429038988993, 0.31883604111561203], [23.911491222019453, 0.27663111094363746, 0.6224071933276384],
    [24.1965258989719, 10.666251935502949, 0.9081445555450511], [14.60864265669915, 7.207746688666603, 0.21990180720972952],
  ];
  const SHOWN = [7, 4, 12];
  const PLANNED = [79.56, 82.43, 91.24];
  const MEAN = { learned: 85.09, planned: 85.46 };
  // What a logit-normal policy (seed 0, greedy) executes on the three: thousandths of a kilowatt, and of a per cent of the vent.
  const LEARNED = [
    {
      power: [
        -164, 7961, 7972, 7977, 7981, 7983, 7983, 7983, 7982, 7982, 7982, 7982, 7982, 7982, 7982, 7982, 7982, 7982,
        7982, 7981, 7981, 7980, 7979, 7978, 7977, 7975, 7973, 7971, 7968, 7965, 7961, 7955, 7944, 7920, 7835, 7422,
        6503, 6006, 5803, 5603, 5412, 5227, 5047, 4871, 4704, 4548, 4405, 4277, 4164, 4069, 3989, 3927, 3881, 3852,
        3840, 3844, 3865, 3902, 3956, 4027, 4110, 4203, 4303, 4408, 4522, 4647, 4786, 4941, 5109, 5291, 5485, 5689,
        5901, 5983, 6097, 6209, 6330, 6456, 6586, 6719, 6856, 6995, 7133, 7269, 7400, 7522, 7632, 7725, 7800, 7857,
        7898, 7926, 7945, 7957, 7966, 7972,
      ],
      vent: [
        134, 20, 17, 15, 14, 13, 13, 13, 13, 13, 14, 14, 15, 16, 17, 19, 21, 23, 26, 28, 32, 35, 39, 43, 47, 52, 56,
        60, 62, 64, 65, 65, 66, 69, 72, 75, 80, 86, 91, 98, 104, 111, 118, 125, 133, 142, 151, 160, 170, 180, 191,
        201, 212, 223, 234, 243, 251, 258, 261, 261, 258, 252, 245, 238, 231, 226, 222, 218, 214, 209, 204, 198,
        191, 182, 171, 160, 149, 137, 125, 113, 101, 91, 81, 72, 65, 58, 52, 47, 42, 37, 33, 29, 25, 22, 20, 18,
      ],
    },
    {
      power: [
        7992, 7992, 7992, 7992, 7991, 7991, 7990, 7989, 7987, 7986, 7983, 7978, 7971, 7959, 7940, 7908, 7851, 7747,
        7588, 7410, 7267, 7161, 7068, 6974, 6875, 6693, 6428, 6170, 5918, 5667, 5418, 5171, 4926, 4687, 4453, 4225,
        4005, 3791, 3583, 3380, 3183, 2994, 2814, 2643, 2484, 2338, 2204, 2085, 1980, 1889, 1812, 1749, 1699, 1663,
        1641, 1634, 1644, 1671, 1719, 1788, 1881, 1995, 2125, 2266, 2411, 2557, 2705, 2860, 3024, 3202, 3394, 3602,
        3823, 3902, 4005, 4112, 4227, 4347, 4474, 4606, 4744, 4886, 5033, 5182, 5334, 5487, 5639, 5790, 5938, 6082,
        6222, 6358, 6488, 6611, 6728, 6838,
      ],
      vent: [
        312, 284, 262, 239, 209, 168, 125, 90, 66, 52, 45, 43, 45, 49, 55, 61, 65, 69, 70, 71, 70, 70, 69, 69, 69,
        65, 63, 62, 62, 63, 65, 68, 72, 76, 82, 89, 98, 107, 119, 133, 149, 168, 192, 219, 251, 288, 329, 373, 419,
        465, 510, 551, 589, 622, 649, 669, 683, 690, 687, 676, 654, 622, 583, 540, 498, 460, 426, 397, 372, 350,
        330, 313, 296, 282, 268, 254, 239, 225, 210, 196, 182, 168, 156, 145, 135, 127, 119, 112, 105, 99, 94, 89,
        84, 80, 76, 72,
      ],
    },
    {
      power: [
        -814, 4191, 5186, 5028, 5117, 5155, 5192, 5222, 5249, 5274, 5296, 5314, 5326, 5331, 5327, 5313, 5289, 5257,
        5217, 5171, 5119, 5062, 5003, 4940, 4874, 4719, 4489, 4230, 3951, 3662, 3373, 3089, 2812, 2543, 2283, 2031,
        1789, 1557, 1336, 1128, 934, 757, 599, 460, 338, 233, 141, 60, -12, -76, -135, -188, -236, -278, -313, -339,
        -355, -357, -341, -305, -245, -159, -49, 83, 230, 388, 553, 725, 905, 1098, 1306, 1530, 1772, 1867, 1962,
        2064, 2174, 2290, 2412, 2541, 2675, 2813, 2955, 3100, 3248, 3396, 3545, 3694, 3840, 3985, 4125, 4261, 4392,
        4516, 4632, 4738,
      ],
      vent: [
        921, 420, 364, 380, 384, 395, 410, 427, 447, 468, 489, 509, 527, 542, 553, 562, 569, 575, 579, 584, 590,
        598, 608, 621, 637, 618, 603, 593, 591, 598, 615, 645, 691, 756, 847, 969, 1134, 1355, 1646, 2027, 2517,
        3131, 3876, 4749, 5732, 6796, 7904, 9013, 10079, 11064, 11929, 12643, 13178, 13513, 13629, 13514, 13161,
        12574, 11769, 10779, 9655, 8465, 7283, 6177, 5194, 4358, 3668, 3110, 2661, 2301, 2011, 1775, 1581, 1471,
        1369, 1273, 1182, 1095, 1013, 935, 862, 795, 735, 681, 634, 593, 557, 526, 499, 475, 454, 436, 420, 406,
        395, 386,
      ],
    },
  ];

  const within = (low, x, high) => Math.min(Math.max(x, low), high);

  function weather(quarter, [, season, sky]) {
    const hour = quarter / 4;
    const outside = season + 6 * Math.sin((2 * Math.PI * (hour - 9)) / 24);
    return { outside, sun: 6 * sky * Math.max(Math.sin((Math.PI * (hour - 6)) / 12), 0) };
  }

  function aQuarterLater(inside, outside, sun, power, vent) {
    const loss = 0.35 + 1.5 * vent;
    const rest = outside + (power + sun) / loss;
    return rest + (inside - rest) * Math.exp((-0.25 * loss) / 0.8);
  }

  // The rule of two lines: what it asks the pump for, and what is executed.
  function rule(numbers) {
    const [night, day, gain, opens] = ["night", "day", "gain", "opens"].map((name) => fround(numbers[name]));
    return (inside, sun) => {
      const seen = fround(inside);
      const asked = fround(gain * fround((sun > 1e-6 ? day : night) - seen));
      return { asked, power: within(0, asked, 8), vent: within(0, fround(fround(seen - opens) / 2), 1) };
    };
  }

  // Actions on record.
  function replay({ power, vent }) {
    return (inside, sun, quarter) => {
      const executed = power[quarter] / 1000;
      return { asked: executed, power: executed, vent: vent[quarter] / 100000 };
    };
  }

  function run(act, day) {
    const found = { inside: [day[0]], outside: [], asked: [], power: [], vent: [], reward: [], cold: 0, warm: 0, pump: 0 };
    let x = day[0];
    for (let quarter = 0; quarter < QUARTERS && x > COLD && x < HOT; quarter++) {
      const { outside, sun } = weather(quarter, day);
      const { asked, power, vent } = act(x, sun, quarter);
      x = aQuarterLater(x, outside, sun, power, vent);
      const [growth, paid] = [Math.exp(-(((x - 21) / 6) ** 2)), 0.02 * Math.abs(power)];
      found[x < 21 ? "cold" : "warm"] += 1 - growth;
      found.pump += paid;
      found.inside.push(x);
      for (const [name, value] of Object.entries({ outside, asked, power, vent, reward: growth - paid })) found[name].push(value);
    }
    found.lost = x <= COLD || x >= HOT;
    found.earned = found.reward.reduce((sum, each) => sum + each, 0);
    return found;
  }

  const mean = (act) => DAYS.reduce((sum, day) => sum + run(act, day).earned, 0) / DAYS.length;
  const CHAPTER = { night: 22, day: 22, gain: 4, opens: 23 };
  return { DAYS, SHOWN, PLANNED, MEAN, LEARNED, CHAPTER, rule, replay, run, mean };
})();

inbounds.models["greenhouse-by-hand"] = ({ which, night, day, gain, opens }) => {
  const { DAYS, SHOWN, PLANNED, MEAN, LEARNED, CHAPTER, rule, replay, run, mean } = inbounds.greenhouse;
  const acts = { yours: rule({ night, day, gain, opens }), chapter: rule(CHAPTER), learned: replay(LEARNED[which]) };
  const names = Object.keys(acts);
  const found = Object.fromEntries(names.map((name) => [name, run(acts[name], DAYS[SHOWN[which]])]));
  const { yours, chapter } = found;
  const means = { yours: mean(acts.yours), chapter: mean(acts.chapter), learned: MEAN.learned };

  const hours = (values) => values.map((_, quarter) => quarter / 4);
  const steps = (values) => ({ // an action is held for a quarter of an hour
    x: values.flatMap((_, quarter) => [quarter / 4, (quarter + 1) / 4]),
    y: values.flatMap((value) => [value, value]),
  });
  const sources = {
    band: { x: [0, 24, 24, 0], y: [17, 17, 25, 25] },
    bounds: { x: [-1, 25, 25, -1], y: [-2, -2, 8, 8] },
    outside: { x: hours(chapter.outside), y: chapter.outside },
    asked: steps(yours.asked),
  };
  for (const name of names) {
    sources[`${name}-inside`] = { x: hours(found[name].inside), y: found[name].inside };
    for (const part of ["power", "vent"]) sources[`${name}-${part}`] = steps(found[name][part]);
  }
  const temperatures = [yours, chapter].flatMap((each) => [...each.inside, ...each.outside]);

  const number = (v, digits = 1) => inbounds.numerics.number(v, digits);
  const cells = (read) => names.map((name) => read(found[name]));
  const atBound = (v, low, high) => Math.min(v - low, high - v) <= 0.001 * (high - low); // or within 0.1 % of one
  const share = (values, low, high) =>
    `${number((100 * values.filter((v) => atBound(v, low, high)).length) / values.length, 0)}\u00a0%`;

  const lead = yours.earned - chapter.earned;
  const compared =
    Math.abs(lead) < 0.05
      ? "earns what the chapter's does"
      : `earns ${number(Math.abs(lead))} ${lead > 0 ? "more" : "less"} than the chapter's`;
  const costs = { cold: "cold", warm: "warmth", pump: "the pump" };
  const most = Object.keys(costs).reduce((a, b) => (yours[b] > yours[a] ? b : a));
  const length = yours.reward.length;
  const clock = `${Math.floor(length / 4)}:${String(15 * (length % 4)).padStart(2, "0")}`;
  return {
    sources,
    ranges: {
      "inside-range": [Math.min(3, ...temperatures) - 1, Math.max(27, ...temperatures) + 1],
      "power-range": [-3, Math.min(14, Math.max(9, Math.max(...yours.asked) + 1))],
      "vent-range": [-0.06, 1.06],
    },
    table: {
      earned: cells((each) => number(each.earned)),
      cold: cells((each) => number(each.cold)),
      warm: cells((each) => number(each.warm)),
      pump: cells((each) => number(each.pump)),
      hours: cells((each) => number(each.inside.slice(1).filter((x) => x >= 17 && x <= 25).length / 4, 2)),
      asked: cells((each) => `${number(Math.max(...each.asked))}\u00a0kW`),
      pump_bound: cells((each) => share(each.power, -2, 8)),
      vent_bound: cells((each) => share(each.vent, 0, 1)),
      mean: names.map((name) => number(means[name], 2)),
    },
    note: yours.lost
      ? `The crop is lost at ${clock}, and the rest of the day earns nothing.`
      : `On this day your rule ${compared}; what costs it most of the 96 points is ${costs[most]}, ${number(yours[most])}. ` +
        `A planner that knows the weather earns ${number(PLANNED[which] - yours.earned)} more.`,
    found, means, // for the tests
  };
};
