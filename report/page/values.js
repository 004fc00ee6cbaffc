// Numbers of the page: packed tables, and how they are written.

const data = JSON.parse(document.getElementById('data').textContent);
const byId = (id) => document.getElementById(id);

/** An element with attributes and children; texts become text nodes. */
function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** Red, green and blue of one of the page's colours, 0 to 255, in the theme that is on. */
function colourOf(name) {
  const probe = byId('probe');
  probe.style.color = `var(${name})`;
  return getComputedStyle(probe).color.match(/[\d.]+/g).slice(0, 3).map(Number);
}

function halfToNumber(bits) {
  const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

const unpacked = new Map();

/** The numbers of one packed array: half floats in base64, times a scale. */
function arrayOf(number) {
  if (!unpacked.has(number)) {
    const { scale, data: text } = data.arrays[number];
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    const values = new Float32Array(bytes.length / 2);
    for (let k = 0; k < values.length; ++k) values[k] = scale * halfToNumber(view.getUint16(2 * k, true));
    unpacked.set(number, values);
  }
  return unpacked.get(number);
}

/** A spherical table with lines to compare: values by channel, parameter row and angles. */
class Slices {
  constructor(json) {
    Object.assign(this, json);
    this.reference = arrayOf(json.reference);
    this.differences = json.lines.map((line) => arrayOf(line.difference));
    this.labels = [json.label, ...json.lines.map((line) => line.label)];
  }
  index({ channel, row, thetaO, thetaI, phi }) {
    return (((channel * this.rows.length + row) * this.theta_o.length + thetaO) * this.theta_i.length + thetaI) *
        this.phi.length + phi;
  }
  /** π f cos θi, or f. */
  factor(quantity, thetaI) {
    return quantity === 'brdf' ? 1 : Math.PI * Math.cos(this.theta_i[thetaI] * Math.PI / 180);
  }
  /** Of the reference (line 0) or one of the others; NaN where the reference has none. */
  value(line, place, quantity) {
    const k = this.index(place);
    const f = line === 0 ? this.reference[k] : this.reference[k] + this.differences[line - 1][k];
    return f * this.factor(quantity, place.thetaI);
  }
  /** A line minus the reference. */
  difference(line, place, quantity) {
    return this.differences[line - 1][this.index(place)] * this.factor(quantity, place.thetaI);
  }
}

/** Numbers as people read them: three or four digits. */
function written(value, digits = 4) {
  if (Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  const text = size >= 1e-3 && size < 1e5 ? value.toPrecision(digits) : value.toExponential(digits - 1);
  return text.replace('-', '−');
}

/** Round numbers from low to high, about `count` of them. */
function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((s) => s * power >= rough * 0.999);
  const list = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) list.push(k * step);
  return list;
}

function powersOfTen(low, high) {
  const list = [];
  for (let k = Math.ceil(Math.log10(low) - 1e-9); k <= Math.log10(high) + 1e-9; ++k) list.push(10 ** k);
  return list;
}

const tickText = (value) => String(Number(value.toPrecision(6))).replace('-', '−');
const degreesText = (value) => `${tickText(Math.round(10 * value) / 10)}°`;
