// Residual maps: a line minus the reference over theta_i and the view, the page's own colour at 0; where there is one view, over
// theta_i and the parameter rows.

const residualPanel = {
  slices: null,

  start() {
    new ResizeObserver(() => this.slices && this.draw()).observe(byId('maps'));
  },

  show(slices) {
    this.slices = slices;
    byId('residuals').hidden = !slices;
    byId('residuals-value').textContent = '';
    if (!slices) {
      byId('maps').replaceChildren();
      return;
    }
    this.overViews = slices.theta_o.length > 1;
    this.canvases = slices.lines.map((line, k) => {
      const canvas = make('canvas', { role: 'img' });
      canvas.addEventListener('pointermove', (event) => this.point(event, k + 1));
      canvas.addEventListener('pointerdown', (event) => this.choose(event));
      return canvas;
    });
    byId('maps').replaceChildren(...slices.lines.map(
        (line, k) => make('figure', {}, make('figcaption', {}, `${line.label} − reference`), this.canvases[k])));
    this.draw();
  },

  /** The cell's place in the table, from its column and its line. */
  cell(column, line) {
    const place = slicePanel.place();
    place.thetaI = column;
    if (this.overViews) place.thetaO = line;
    else place.row = line;
    return place;
  },

  lines() { return this.overViews ? this.slices.theta_o.length : this.slices.rows.length; },
  lineLabel(line) { return this.overViews ? degreesText(this.slices.theta_o[line]) : this.slices.rows[line]; },

  draw() {
    const slices = this.slices, quantity = slicePanel.quantity(), columns = slices.theta_i.length, lines = this.lines();
    let largest = 0;
    const residuals = slices.lines.map((_, k) => {
      const values = [];
      for (let line = 0; line < lines; ++line) {
        for (let column = 0; column < columns; ++column) {
          values.push(slices.difference(k + 1, this.cell(column, line), quantity));
          if (Number.isFinite(values.at(-1))) largest = Math.max(largest, Math.abs(values.at(-1)));
        }
      }
      return values;
    });
    this.residuals = residuals;
    const [low, middle, high] = ['--low', '--middle', '--high'].map(colourOf);
    const [masked, faint] = ['--masked', '--faint'].map((name) => `rgb(${colourOf(name).join(',')})`);
    const fill = (v) => {
      if (!Number.isFinite(v)) return masked;
      const end = v < 0 ? low : high, t = largest > 0 ? Math.abs(v) / largest : 0;
      return `rgb(${middle.map((c, k) => Math.round(c + (end[k] - c) * t)).join(',')})`;
    };
    this.canvases.forEach((canvas, k) => this.drawMap(canvas, residuals[k], k, fill, largest, faint));
    const place = slicePanel.place();
    byId('residuals-note').textContent = (quantity === 'brdf' ? 'f' : 'π f cos θᵢ') + ' of the model minus that of the ' +
        `reference, at φ = ${degreesText(slices.phi[place.phi])}` +
        (this.overViews ? `, ${slices.rows[place.row] || 'all parameters fixed'}; θᵢ across, θₒ upwards.`
                        : `, θₒ = ${degreesText(slices.theta_o[place.thetaO])}; θᵢ across, parameter rows upwards.`) +
        ' Choose a line of the map to see its slice.';
  },

  drawMap(canvas, values, k, fill, largest, faint) {
    const columns = this.slices.theta_i.length, lines = this.lines();
    const width = Math.max(canvas.parentElement.clientWidth, 200), height = Math.round(width * 0.86);
    const ratio = window.devicePixelRatio || 1;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    canvas.style.height = `${height}px`;
    const box = { left: this.overViews ? 34 : 72, right: 10, top: 8, bottom: 52 };
    const context = canvas.getContext('2d');
    context.scale(ratio, ratio);
    const w = (width - box.left - box.right) / columns, h = (height - box.top - box.bottom) / lines;
    const x = (column) => box.left + column * w, y = (line) => height - box.bottom - (line + 1) * h;
    values.forEach((v, at) => {
      context.fillStyle = fill(v);
      // Half a pixel over: neighbours leave no seams.
      context.fillRect(x(at % columns), y(Math.floor(at / columns)), w + 0.5, h + 0.5);
    });
    context.fillStyle = context.strokeStyle = faint;
    context.font = '11px system-ui, "DejaVu Sans", sans-serif';
    context.textAlign = 'center';
    const every = Math.max(1, Math.round(columns / 4)), skip = Math.max(1, Math.round(lines / 5));
    for (let column = 0; column < columns; column += every)
      context.fillText(degreesText(this.slices.theta_i[column]), x(column) + w / 2, height - box.bottom + 14);
    context.textAlign = 'right';
    for (let line = 0; line < lines; line += skip)
      context.fillText(this.lineLabel(line), box.left - 4, y(line) + h / 2 + 4, box.left - 6);
    // The slice shown above.
    const place = slicePanel.place(), shown = this.overViews ? place.thetaO : place.row;
    context.strokeRect(box.left, y(shown), columns * w, h);
    // The colours' scale.
    const bar = { left: box.left, top: height - 26, width: columns * w, height: 8 };
    for (let t = 0; t < bar.width; ++t) {
      context.fillStyle = fill((2 * t / bar.width - 1) * largest);
      context.fillRect(bar.left + t, bar.top, 1.5, bar.height);
    }
    context.fillStyle = faint;
    context.textAlign = 'left';
    context.fillText(written(-largest, 3), bar.left, height - 4);
    context.textAlign = 'center';
    context.fillText('0', bar.left + bar.width / 2, height - 4);
    context.textAlign = 'right';
    context.fillText(`+${written(largest, 3)}`, bar.left + bar.width, height - 4);
    canvas.box = { ...box, w, h, height };
    const worst = values.reduce((best, v, at) => Math.abs(v) > Math.abs(values[best] || 0) ? at : best, 0);
    canvas.setAttribute('aria-label', `${this.slices.lines[k].label} minus reference: largest ${written(values[worst], 3)} ` +
        `at theta_i ${tickText(this.slices.theta_i[worst % columns])} degrees, ${this.lineLabel(Math.floor(worst / columns))}`);
  },

  /** Column and line under the pointer, or null. */
  hit(event) {
    const canvas = event.currentTarget, { left, bottom, w, h, height } = canvas.box, frame = canvas.getBoundingClientRect();
    const column = Math.floor((event.clientX - frame.left - left) / w);
    const line = Math.floor((height - bottom - (event.clientY - frame.top)) / h);
    const inside = column >= 0 && column < this.slices.theta_i.length && line >= 0 && line < this.lines();
    return inside ? { column, line } : null;
  },

  point(event, line) {
    const hit = this.hit(event);
    byId('residuals-value').textContent = hit ?
        `${this.slices.labels[line]}: ${written(this.residuals[line - 1][hit.line * this.slices.theta_i.length + hit.column], 3)} at ` +
        `θᵢ = ${degreesText(this.slices.theta_i[hit.column])}, ${this.overViews ? 'θₒ = ' : ''}${this.lineLabel(hit.line)}` : '';
  },

  choose(event) {
    const hit = this.hit(event);
    if (!hit) return;
    (this.overViews ? slicePanel.inputs.thetaO : slicePanel.inputs.row).value = hit.line;
    slicePanel.marker = hit.column;
    slicePanel.draw();
  },
};
