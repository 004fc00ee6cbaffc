// Slices: values over theta_i at one view, azimuth and parameter row, along the angle or around it.

const dashes = ['', '', '7 4', '2 4', '9 3 2 3'];
const lineColour = (line) => `var(--line-${line % 5})`;
const svgNamespace = 'http://www.w3.org/2000/svg';

function draw(parent, name, attributes, text) {
  const element = document.createElementNS(svgNamespace, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

/** Lower and upper end of the values' axis and the place of a value on it, 0 to 1. */
function valueAxis(values, logarithmic) {
  const finite = values.filter(Number.isFinite);
  if (logarithmic) {
    const positive = finite.filter((v) => v > 0);
    const high = positive.length ? Math.max(...positive) * 1.15 : 1;
    // Below a millionth of the highest nothing is told apart.
    const low = Math.max(positive.length ? Math.min(...positive) / 1.15 : 0.1, high * 1e-6);
    const span = Math.log(high / low);
    const decades = powersOfTen(low, high);
    return {
      low, high,
      at: (v) => v > 0 ? Math.max(Math.log(v / low) / span, 0) : 0,
      ticks: decades.length > 1 ? decades : ticks(low, high, 4).filter((v) => v > 0),
    };
  }
  const high = Math.max(0, ...finite) * 1.05 || 1, low = Math.min(0, ...finite) * 1.05;
  return { low, high, at: (v) => (v - low) / (high - low), ticks: ticks(low, high, 5) };
}

/** A line over a chart: points, null where it is open. */
function drawLine(svg, line, points) {
  let d = '', open = false;
  for (const point of points) {
    if (point) d += `${open ? 'L' : 'M'}${point[0].toFixed(1)} ${point[1].toFixed(1)}`;
    open = point !== null;
  }
  draw(svg, 'path', {
    class: 'line', d, stroke: lineColour(line), 'stroke-dasharray': dashes[line % dashes.length],
    'stroke-width': line === 0 ? 3 : 2,
  });
}

function swatchOf(line) {
  const swatch = make('span', { class: 'swatch' });
  swatch.style.borderTopColor = lineColour(line);
  if (dashes[line % dashes.length]) swatch.style.borderTopStyle = 'dashed';
  return swatch;
}

/** Axes over a half plane: the radius is the value, the angle that to the normal, positive to the right. */
function polarChart(width, height, axis) {
  const svg = document.createElementNS(svgNamespace, 'svg');
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.setAttribute('aria-hidden', 'true');
  const radius = Math.min(width / 2 - 24, height - 48), cx = width / 2, cy = height - 26;
  const place = (angle, r) => [cx + r * Math.sin(angle * Math.PI / 180), cy - r * Math.cos(angle * Math.PI / 180)];
  const point = ([angle, value]) => Number.isFinite(value) ? place(angle, radius * Math.max(axis.at(value), 0)) : null;
  for (const tick of axis.ticks) {
    const r = radius * axis.at(tick);
    if (r < 8) continue;
    draw(svg, 'path', { class: 'grid', d: `M${cx - r} ${cy}A${r} ${r} 0 0 1 ${cx + r} ${cy}` });
    draw(svg, 'text', { x: cx + r, y: cy + 16, 'text-anchor': 'middle' }, tickText(tick));
  }
  for (const angle of [-90, -60, -30, 0, 30, 60, 90]) {
    const [x, y] = place(angle, radius + 6);
    draw(svg, 'path', { class: 'grid', d: `M${cx} ${cy}L${x} ${y}` });
    if (Math.abs(angle) < 90) {
      const [textX] = place(angle, radius + 16), [, textY] = place(angle, radius + 10);
      draw(svg, 'text', { x: textX, y: textY, 'text-anchor': 'middle' }, `${Math.abs(angle)}°`);
    }
  }
  return {
    svg, point,
    line: (line, points) => drawLine(svg, line, points.map(point)),
    ray(angle, label) {
      const [x, y] = place(angle, radius), [textX, textY] = place(angle, radius - 14);
      draw(svg, 'path', { class: 'marker', d: `M${cx} ${cy}L${x} ${y}` });
      draw(svg, 'text', { x: textX + 4, y: textY }, label);
    },
    angleAt: (px, py) => Math.abs(Math.atan2(px - cx, cy - py)) * 180 / Math.PI,
  };
}

const slicePanel = {
  slices: null,
  onChange: () => {},

  start() {
    this.inputs = { thetaO: byId('theta-o'), phi: byId('phi'), row: byId('parameter-row') };
    for (const id of ['theta-o', 'phi', 'parameter-row', 'quantity', 'scale', 'drawing', 'channel'])
      byId(id).addEventListener('input', () => this.draw());
    const chart = byId('slice-chart');
    chart.addEventListener('pointermove', (event) => this.point(event));
    chart.addEventListener('pointerdown', (event) => this.point(event));
    chart.addEventListener('keydown', (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1, Home: -1e9, End: 1e9 }[event.key];
      if (!step || !this.slices) return;
      event.preventDefault();
      this.marker = Math.min(Math.max(this.marker + step, 0), this.slices.theta_i.length - 1);
      this.draw();
    });
    new ResizeObserver(() => this.slices && this.draw()).observe(chart);
  },

  show(slices) {
    byId('slices').hidden = !slices;
    this.slices = slices;
    if (!slices) return;
    this.marker = Math.floor(slices.theta_i.length * 2 / 3);
    const prepare = (input, count, value) => {
      input.max = count - 1;
      input.value = value;
      input.parentElement.hidden = count < 2;
    };
    prepare(this.inputs.thetaO, slices.theta_o.length, Math.floor(slices.theta_o.length * 2 / 3));
    prepare(this.inputs.phi, slices.phi.length, 0);
    prepare(this.inputs.row, slices.rows.length, Math.floor(slices.rows.length * 2 / 3));
    byId('channel').parentElement.hidden = slices.channels < 2;
    byId('channel').value = '1';
    byId('quantity').value = slices.quantity === 'brdf' ? 'brdf' : 'cosine';
    this.draw();
  },

  /** What the sliders choose. */
  place() {
    const slices = this.slices;
    return {
      channel: slices.channels > 1 ? Number(byId('channel').value) : 0,
      row: Number(this.inputs.row.value),
      thetaO: Number(this.inputs.thetaO.value),
      phi: Number(this.inputs.phi.value),
    };
  },

  quantity: () => byId('quantity').value,

  /** The azimuth beyond the normal, or -1: light and mirror image are one to an isotropic surface. */
  opposite(phi) {
    const across = (this.slices.phi[phi] + 180) % 360;
    return this.slices.phi.findIndex((p) => Math.abs(p - across) < 1e-6 || Math.abs(360 - p - across) < 1e-6);
  },

  draw() {
    const slices = this.slices, place = this.place();
    byId('theta-o-value').textContent = degreesText(slices.theta_o[place.thetaO]);
    byId('phi-value').textContent = degreesText(slices.phi[place.phi]) +
        (slices.phi[place.phi] === 0 ? ', retro side' : slices.phi[place.phi] === 180 ? ', mirror side' : '');
    byId('parameter-row-value').textContent = slices.rows[place.row];
    this.inputs.thetaO.setAttribute('aria-valuetext', degreesText(slices.theta_o[place.thetaO]));
    this.inputs.phi.setAttribute('aria-valuetext', degreesText(slices.phi[place.phi]));
    this.inputs.row.setAttribute('aria-valuetext', slices.rows[place.row]);

    const lines = slices.labels.map((_, line) => slices.theta_i.map(
        (_, thetaI) => slices.value(line, { ...place, thetaI }, this.quantity())));
    const chart = byId('slice-chart');
    const width = Math.max(chart.clientWidth, 280);
    const polar = byId('drawing').value === 'polar';
    const height = polar ? Math.round(Math.min(width * 0.56, 420)) : Math.round(Math.min(Math.max(width * 0.5, 240), 420));
    chart.replaceChildren(polar ? this.drawPolar(width, height, lines, place) : this.drawAlong(width, height, lines));
    this.readOut(lines);
    this.onChange();
  },

  drawAlong(width, height, lines) {
    const svg = document.createElementNS(svgNamespace, 'svg');
    svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    svg.setAttribute('aria-hidden', 'true');
    const slices = this.slices, left = 52, right = 14, top = 16, bottom = 40;
    const first = Math.min(0, slices.theta_i[0]), last = Math.max(90, slices.theta_i.at(-1));
    const x = (angle) => left + (angle - first) / (last - first) * (width - left - right);
    const axis = valueAxis(lines.flat(), byId('scale').value === 'log');
    const y = (value) => height - bottom - Math.min(Math.max(axis.at(value), 0), 1) * (height - top - bottom);
    for (const tick of axis.ticks) {
      draw(svg, 'path', { class: 'grid', d: `M${left} ${y(tick)}H${width - right}` });
      draw(svg, 'text', { x: left - 6, y: y(tick) + 4, 'text-anchor': 'end' }, tickText(tick));
    }
    for (let angle = first; angle <= last; angle += width < 480 ? 30 : 15) {
      draw(svg, 'path', { class: 'grid', d: `M${x(angle)} ${top}V${height - bottom}` });
      draw(svg, 'text', { x: x(angle), y: height - bottom + 16, 'text-anchor': 'middle' }, `${angle}°`);
    }
    draw(svg, 'text', { x: (left + width - right) / 2, y: height - 6, 'text-anchor': 'middle' }, 'θᵢ');
    const at = x(slices.theta_i[this.marker]);
    draw(svg, 'path', { class: 'marker', d: `M${at} ${top}V${height - bottom}` });
    lines.forEach((values, line) => {
      drawLine(svg, line, values.map((v, k) => Number.isFinite(v) ? [x(slices.theta_i[k]), y(v)] : null));
      const marked = values[this.marker];
      if (Number.isFinite(marked)) draw(svg, 'circle', { cx: at, cy: y(marked), r: 3.5, fill: lineColour(line) });
    });
    this.angleAt = (px) => first + (px - left) / (width - left - right) * (last - first);
    return svg;
  },

  /** The chosen azimuth to the right, its opposite to the left. */
  drawPolar(width, height, lines, place) {
    const slices = this.slices, across = this.opposite(place.phi);
    const other = across < 0 ? [] : slices.labels.map((_, line) => slices.theta_i.map(
        (_, thetaI) => slices.value(line, { ...place, phi: across, thetaI }, this.quantity())));
    const polar = polarChart(width, height, valueAxis(lines.concat(other).flat(), byId('scale').value === 'log'));
    // The viewer stands at azimuth 0: on the chosen side if that is 0, opposite to it if it is 180.
    const side = slices.phi[place.phi] === 0 ? 1 : slices.phi[place.phi] === 180 ? -1 : 0;
    if (side) polar.ray(side * slices.theta_o[place.thetaO], 'viewer');
    lines.forEach((values, line) => {
      const right = values.map((v, k) => [slices.theta_i[k], v]);
      const left = (other[line] ?? []).map((v, k) => [-slices.theta_i[k], v]);
      polar.line(line, left.reverse().concat(right));
      const marked = polar.point(right[this.marker]);
      if (marked) draw(polar.svg, 'circle', { cx: marked[0], cy: marked[1], r: 3.5, fill: lineColour(line) });
    });
    this.angleAt = polar.angleAt;
    return polar.svg;
  },

  point(event) {
    const svg = byId('slice-chart').querySelector('svg');
    if (!svg) return;
    const box = svg.getBoundingClientRect(), scale = svg.viewBox.baseVal.width / box.width;
    const angle = this.angleAt((event.clientX - box.left) * scale, (event.clientY - box.top) * scale);
    let nearest = 0;
    this.slices.theta_i.forEach((t, k, all) => {
      if (Math.abs(t - angle) < Math.abs(all[nearest] - angle)) nearest = k;
    });
    if (nearest === this.marker) return;
    this.marker = nearest;
    this.draw();
  },

  readOut(lines) {
    const slices = this.slices, place = { ...this.place(), thetaI: this.marker };
    byId('marker-value').textContent = `At θᵢ = ${degreesText(slices.theta_i[this.marker])}` +
        (byId('drawing').value === 'polar' ? '; the chosen azimuth is on the right, the opposite one on the left' : '');
    byId('readout').replaceChildren(...lines.map((values, line) => {
      const difference = line === 0 ? '' : written(slices.difference(line, place, this.quantity()), 3);
      return make('tr', {}, make('th', { scope: 'row' }, swatchOf(line), slices.labels[line]),
          make('td', {}, written(values[this.marker])), make('td', {}, difference));
    }));
  },
};
