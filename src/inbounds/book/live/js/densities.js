// One small plot a motor: the law's density over unit actions, what was drawn and what the robot executed.
//
// The box between the bounds is tinted. A ring stands where the policy drew, a dot where the robot acts; where the two
// differ, a line joins them: that is the clip. Bars at the bounds are the probability of being clipped to them.
"use strict";

inbounds.live.Densities = class {
  static REACH = 1.8; // unit actions from -1.8 to 1.8
  static HEIGHT = 78; // of a plot [CSS pixels]
  static POINTS = 72;

  // Where a curve is computed, in order: evenly, and around the law's bulk, which may be narrower than that.
  static units(law, p) {
    const { REACH, POINTS } = inbounds.live.Densities;
    const evenly = Array.from({ length: POINTS }, (_, i) => -REACH + (2 * REACH * (i + 0.5)) / POINTS);
    const around = Array.from({ length: 33 }, (_, i) => law.near(p, (i - 16) / 4));
    return [...evenly, ...around.filter((unit) => Math.abs(unit) <= REACH)].sort((a, b) => a - b);
  }

  constructor(canvas, motors, family) {
    this.canvas = canvas;
    this.motors = motors;
    this.law = inbounds.live.laws[family];
  }

  // Lay out the plots in as many columns as fit.
  layout() {
    const width = this.canvas.clientWidth;
    const columns = Math.max(1, Math.min(this.motors.length, Math.floor(width / 100)));
    const rows = Math.ceil(this.motors.length / columns);
    const height = rows * inbounds.live.Densities.HEIGHT;
    const ratio = Math.min(devicePixelRatio, 2);
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.style.height = `${height}px`;
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    return { ratio, columns, width: width / columns };
  }

  draw(parameters, told, colors) {
    const { HEIGHT } = inbounds.live.Densities;
    const { ratio, columns, width } = this.layout();
    const paint = this.canvas.getContext("2d");
    paint.setTransform(ratio, 0, 0, ratio, 0, 0);
    paint.clearRect(0, 0, this.canvas.width, this.canvas.height);
    parameters.forEach((p, i) => {
      paint.save();
      paint.translate((i % columns) * width, Math.floor(i / columns) * HEIGHT);
      this.plot(paint, width - 14, this.motors[i], p, told.drawn[i], told.executed[i], colors);
      paint.restore();
    });
  }

  plot(paint, width, name, p, drawn, executed, colors) {
    const { REACH, HEIGHT, POINTS } = inbounds.live.Densities;
    const [top, base] = [16, HEIGHT - 12];
    const x = (unit) => (width * (Math.min(Math.max(unit, -REACH), REACH) + REACH)) / (2 * REACH);
    paint.fillStyle = colors.box;
    paint.fillRect(x(-1), top, x(1) - x(-1), base - top);
    paint.fillStyle = colors.ink;
    paint.font = `11px ${colors.font}`;
    paint.fillText(name, 0, 11, width);

    const units = inbounds.live.Densities.units(this.law, p);
    const heights = units.map((unit) => this.law.density(p, unit));
    const highest = Math.max(...heights, 1e-9);
    paint.beginPath();
    heights.forEach((h, i) => paint.lineTo(x(units[i]), base - ((base - top - 3) * h) / highest));
    paint.strokeStyle = colors.curve;
    paint.lineWidth = 2;
    paint.stroke();

    paint.fillStyle = colors.clip;
    this.law.beyond(p).forEach((mass, side) => {
      const tall = (base - top) * mass;
      paint.fillRect(x(side ? 1 : -1) - 2, base - tall, 4, tall);
    });
    this.marks(paint, x, base, drawn, executed, colors);
  }

  marks(paint, x, base, drawn, executed, colors) {
    paint.strokeStyle = colors.line;
    paint.lineWidth = 1;
    paint.beginPath();
    paint.moveTo(x(-9), base);
    paint.lineTo(x(9), base);
    paint.stroke();
    const y = base + 5;
    if (drawn !== executed) {
      paint.strokeStyle = colors.clip;
      paint.lineWidth = 3;
      paint.beginPath();
      paint.moveTo(x(drawn), y);
      paint.lineTo(x(executed), y);
      paint.stroke();
    }
    const circle = (unit, radius) => {
      paint.beginPath();
      paint.arc(x(unit), y, radius, 0, 2 * Math.PI);
    };
    paint.strokeStyle = paint.fillStyle = colors.ink;
    paint.lineWidth = 1.5;
    circle(drawn, 4);
    paint.stroke();
    circle(executed, 2.5);
    paint.fill();
  }
};
