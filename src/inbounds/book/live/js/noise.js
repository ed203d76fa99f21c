// Random numbers from a seed, the same in every browser: xoshiro128** (Blackman and Vigna 2021), seeded by splitmix32.
"use strict";

inbounds.live.Noise = class {
  constructor(seed) {
    let state = seed >>> 0;
    this.state = Uint32Array.from({ length: 4 }, () => {
      state = (state + 0x9e3779b9) >>> 0;
      let z = state;
      z = Math.imul(z ^ (z >>> 16), 0x85ebca6b);
      z = Math.imul(z ^ (z >>> 13), 0xc2b2ae35);
      return z ^ (z >>> 16);
    });
  }

  // Uniform on (0, 1).
  uniform() {
    const s = this.state;
    const turn = (x, k) => ((x << k) | (x >>> (32 - k))) >>> 0;
    const result = Math.imul(turn(Math.imul(s[1], 5), 7), 9) >>> 0;
    const t = s[1] << 9;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = turn(s[3], 11);
    return (result + 0.5) / 4294967296;
  }

  // Standard normal, by Box and Muller.
  normal() {
    return Math.sqrt(-2 * Math.log(this.uniform())) * Math.cos(2 * Math.PI * this.uniform());
  }

  normals(count) {
    return Array.from({ length: count }, () => this.normal());
  }
};
