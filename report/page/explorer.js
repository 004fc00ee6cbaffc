// The explorer: spheres side by side under one light, polar lobes and image slices, and sliders for the parameters. Where
// the row has slices over both angles, their reference stands beside the models, and what the models miss of it.

const explorerPanel = {
  explorer: null,

  start() {
    const spheres = byId('spheres');
    for (const id of ['light-theta', 'light-phi', 'exposure', 'lobe-theta', 'lobe-scale', 'image-axis'])
      byId(id).addEventListener('input', () => this.draw());
    byId('reset').addEventListener('click', () => {
      for (const [id, value] of Object.entries({ 'light-theta': 45, 'light-phi': 135, exposure: 0, 'lobe-theta': 45 }))
        byId(id).value = value;
      this.chooseRow(this.row);
    });
    spheres.addEventListener('pointerdown', (event) => {
      if (event.target instanceof HTMLCanvasElement) event.target.setPointerCapture(event.pointerId);
      this.turn(event);
    });
    spheres.addEventListener('pointermove', (event) => {
      if (event.target.hasPointerCapture(event.pointerId)) this.turn(event);
    });
    spheres.addEventListener('keydown', (event) => {
      const [id, step] = {
        ArrowLeft: ['light-phi', 5], ArrowRight: ['light-phi', -5], ArrowUp: ['light-theta', 5], ArrowDown: ['light-theta', -5],
      }[event.key] ?? [];
      if (!id) return;
      event.preventDefault();
      const input = byId(id), value = Number(input.value) + step;
      input.value = id === 'light-phi' ? (value + 360) % 360 : value;
      this.draw();
    });
    new ResizeObserver(() => {
      if (this.explorer && spheres.clientWidth !== this.width) this.draw();
    }).observe(spheres);
  },

  show(explorer, text, slices) {
    byId('explorer').hidden = !explorer;
    this.explorer = explorer;
    if (!explorer) return;
    // A reference of one view says nothing of the others.
    this.slices = slices && slices.theta_o.length > 1 && slices.theta_i.length > 1 ? slices : null;
    if (this.text !== text || !brdfs.program) {
      this.text = text;
      const failure = brdfs.compile(text, explorer.model);
      this.failed = failure !== null;
      byId('explorer-failure').textContent = failure ?? '';
      byId('explorer-failure').hidden = !this.failed;
      byId('explorer-pictures').hidden = this.failed;
    }
    this.makePanels();
    this.chooseRow(slices ? slicePanel.place().row : 0);
  },

  /** A picture per model, the reference, and a difference per model. */
  makePanels() {
    const { spheres } = this.explorer;
    this.panels = spheres.map((label, sphere) => ({ shown: 'model', sphere, label }));
    if (this.slices) {
      this.panels.push({ shown: 'reference', sphere: 0, label: this.slices.label });
      this.panels.push(...spheres.map((label, sphere) => ({ shown: 'difference', sphere, label: `${label} − reference` })));
    }
    for (const id of ['spheres', 'image-slices']) {
      byId(id).replaceChildren(...this.panels.map(({ label }) =>
          make('figure', {}, make('canvas', { role: 'img', 'aria-label': label }), make('figcaption', {}, label))));
    }
    byId('difference-note').hidden = !this.slices;
  },

  /** Parameters and reference of one parameter row, as the page has them. */
  chooseRow(row) {
    if (!this.explorer) return;
    this.row = row;
    // [parameter][sphere][component]
    this.values = this.explorer.parameters.map(
        (parameter) => parameter.values[Math.min(row, parameter.values.length - 1)].map((value) => [...value]));
    this.makeControls();
    if (this.failed) return;
    brdfs.setReference(this.slices, row);
    byId('reference-note').textContent = this.slices ?
        `The reference is ${this.slices.label}${this.slices.rows[row] ? ', ' + this.slices.rows[row] : ''}: linear between the ` +
        'angles of its table, beyond the last as there' +
        (this.slices.rows.length > 1 ? '; all follow the slider Parameters above.' : '.') : '';
    this.draw();
  },

  draw() {
    const minus = (text) => text.replace('-', '−');
    for (const id of ['light-theta', 'light-phi', 'exposure']) byId(`${id}-value`).textContent = minus(byId(id).value);
    byId('lobe-theta-value').textContent = `${byId('lobe-theta').value}°`;
    if (this.failed) return;
    this.width = byId('spheres').clientWidth;
    this.drawPanels('spheres', 'sphere');
    this.drawPanels('image-slices', 'image');
    this.drawLobes();
  },

  drawPanels(id, view) {
    const theta = byId('light-theta').value * Math.PI / 180, phi = byId('light-phi').value * Math.PI / 180;
    const uniforms = {
      light: [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)],
      exposure: 2 ** byId('exposure').value,
      square_root: byId('image-axis').value === 'root' ? 1 : 0,
    };
    for (const name of ['low', 'middle', 'high']) uniforms[name] = colourOf(`--${name}`).map((c) => c / 255);
    byId(id).querySelectorAll('canvas').forEach((canvas, k) => {
      const { shown, sphere } = this.panels[k];
      const values = this.values.map((value) => value[sphere]);
      brdfs.draw(canvas, canvas.clientWidth, view, shown, this.explorer.parameters, values, uniforms);
    });
  },

  /** Read back from the graphics card, so that the curves are those of the shader. */
  drawLobes() {
    const thetaI = byId('lobe-theta').value * Math.PI / 180, chart = byId('lobe-chart');
    const panels = this.panels.filter((panel) => panel.shown !== 'difference');
    // The reference first, as among the slices.
    panels.sort((a, b) => (a.shown === 'reference' ? 0 : 1) - (b.shown === 'reference' ? 0 : 1));
    this.lobes = panels.map(({ shown, sphere, label }) => ({
      label,
      values: brdfs.lobe(shown, this.explorer.parameters, this.values.map((value) => value[sphere]), thetaI),
    }));
    const first = panels[0].shown === 'reference' ? 0 : 1;
    const axis = valueAxis(this.lobes.flatMap((lobe) => lobe.values), byId('lobe-scale').value === 'log');
    const width = Math.max(chart.clientWidth, 280), height = Math.round(Math.min(width * 0.56, 420));
    const polar = polarChart(width, height, axis);
    polar.ray(-Number(byId('lobe-theta').value), 'light');
    this.lobes.forEach(({ values }, k) => polar.line(first + k, values.map((v, at) => [lobeAngles[at], v])));
    chart.replaceChildren(polar.svg);
    byId('lobe-readout').replaceChildren(...this.lobes.map(({ label, values }, k) => {
      const highest = values.reduce((best, v, at) => v > values[best] ? at : best, 0);
      return make('tr', {}, make('th', { scope: 'row' }, swatchOf(first + k), label), make('td', {}, written(values[highest])),
          make('td', {}, degreesText(lobeAngles[highest])));
    }));
  },

  /** The light goes where the sphere under the pointer would face it: its edge is 90° from the viewer. */
  turn(event) {
    if (!(event.target instanceof HTMLCanvasElement)) return;
    const box = event.target.getBoundingClientRect();
    const right = 2 * (event.clientX - box.left) / box.width - 1, up = 1 - 2 * (event.clientY - box.top) / box.height;
    byId('light-theta').value = Math.round(Math.min(Math.hypot(right, up) * 90, 180));
    byId('light-phi').value = Math.round((Math.atan2(up, right) * 180 / Math.PI + 360) % 360);
    this.draw();
  },

  makeControls() {
    const { parameters, spheres, model } = this.explorer;
    const group = (legend, controls) => make('fieldset', {}, make('legend', {}, legend), make('div', { class: 'sliders' }, ...controls));
    const everySphere = spheres.map((_, sphere) => sphere);
    const shared = parameters.flatMap((p, k) => p.apart && spheres.length > 1 ? [] : this.control(p, k, everySphere));
    const groups = shared.length ? [group(spheres.length > 1 ? 'All spheres' : model, shared)] : [];
    if (spheres.length > 1) {
      spheres.forEach((label, sphere) => {
        const own = parameters.flatMap((p, k) => p.apart ? this.control(p, k, [sphere]) : []);
        if (own.length) groups.push(group(label, own));
      });
    }
    byId('parameters').replaceChildren(...groups);
  },

  /** Inputs of one parameter, for some of the spheres: a choice, or a slider and a number per component. */
  control(parameter, k, spheres) {
    const components = this.values[k][spheres[0]];
    const set = (component, value) => {
      for (const sphere of spheres) this.values[k][sphere][component] = value;
      this.draw();
    };
    return components.map((value, component) => {
      const id = `parameter-${k}-${spheres[0]}-${component}`;
      const name = parameter.name + (components.length === 3 ? '.' + 'rgb'[component] : '') +
          (parameter.symbol ? ` ${parameter.symbol}` : '') + (parameter.unit ? `, ${parameter.unit}` : '');
      const label = make('label', { for: id, title: parameter.doc }, name);
      if (parameter.choices.length) {
        const select = make('select', { id }, ...parameter.choices.map((choice, c) => make('option', { value: c }, choice)));
        select.value = Math.round(value);
        select.addEventListener('input', () => set(component, Number(select.value)));
        return make('div', { class: 'parameter' }, label, select);
      }
      const range = { min: parameter.lower, max: parameter.upper };
      const slider = make('input', { id, type: 'range', ...range, step: (parameter.upper - parameter.lower) / 500, value });
      const number = make('input', { type: 'number', ...range, step: 'any', value: Number(value.toPrecision(6)), 'aria-label': name });
      slider.addEventListener('input', () => {
        number.value = Number(Number(slider.value).toPrecision(6));
        set(component, Number(slider.value));
      });
      number.addEventListener('input', () => {
        const wanted = Number(number.value);
        if (number.value === '' || !number.validity.valid) return;
        slider.value = wanted;
        set(component, wanted);
      });
      return make('div', { class: 'parameter' }, label, slider, number);
    });
  },
};
