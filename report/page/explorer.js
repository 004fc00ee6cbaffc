// Spheres side by side, lit by one light, drawn by the row's exported GLSL.
//
// The text is that of `lobefit export`, unchanged: it is GLSL 4.50 and OpenGL ES 3.00 at once, but for the precision
// that stands before it. World and samples are those of `lobefit sphere`: x right, y up, z towards the viewer, four
// samples per pixel, π f cos under one white light, 8-bit sRGB.

const vertexShader = `#version 300 es
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}`;

const fragmentShader = (text, model) => `#version 300 es
precision highp float;
precision highp int;
${text}
uniform Lobefit_${model}_Parameters parameters;
uniform vec3 light;
uniform float exposure;
uniform vec2 corner;
uniform float side;
out vec4 colour;

vec3 encode(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(1.055 * pow(max(c, 1e-6), vec3(1.0 / 2.4)) - 0.055, 12.92 * c, vec3(lessThanEqual(c, vec3(0.0031308))));
}

void main() {
    vec3 sum = vec3(0.0);
    float cover = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec2 at = gl_FragCoord.xy - corner + vec2(float(k % 2) * 0.5 - 0.25, float(k / 2) * 0.5 - 0.25);
        vec2 p = 2.0 * at / side - 1.0;
        float radius2 = dot(p, p);
        if (radius2 >= 1.0) continue;
        vec3 z = vec3(p, sqrt(1.0 - radius2));
        vec3 x = normalize(vec3(z.z, 0.0, -z.x));
        mat3 frame = mat3(x, cross(z, x), z);
        vec3 wi = light * frame;
        cover += 1.0;
        if (wi.z > 0.0) sum += Lobefit_${model}(wi, vec3(0.0, 0.0, 1.0) * frame, parameters) * wi.z;
    }
    vec3 radiance = cover > 0.0 ? exposure * 3.14159265 * sum / cover : vec3(0.0);
    colour = vec4(encode(radiance), 1.0) * (cover / 4.0);
}`;

const explorerPanel = {
  explorer: null,

  start() {
    const canvas = byId('spheres');
    for (const id of ['light-theta', 'light-phi', 'exposure']) byId(id).addEventListener('input', () => this.draw());
    byId('reset').addEventListener('click', () => {
      byId('light-theta').value = 45;
      byId('light-phi').value = 135;
      byId('exposure').value = 0;
      this.show(this.explorer, this.text);
    });
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.turn(event);
    });
    canvas.addEventListener('pointermove', (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) this.turn(event);
    });
    canvas.addEventListener('keydown', (event) => {
      const [id, step] = {
        ArrowLeft: ['light-phi', 5], ArrowRight: ['light-phi', -5], ArrowUp: ['light-theta', 5], ArrowDown: ['light-theta', -5],
      }[event.key] ?? [];
      if (!id) return;
      event.preventDefault();
      const input = byId(id), value = Number(input.value) + step;
      input.value = id === 'light-phi' ? (value + 360) % 360 : value;
      this.draw();
    });
    new ResizeObserver(() => this.explorer && this.draw()).observe(canvas.parentElement);
  },

  show(explorer, text) {
    byId('explorer').hidden = !explorer;
    this.explorer = explorer;
    if (!explorer) return;
    const changed = this.text !== text || !this.program;
    this.text = text;
    // [parameter][sphere][component]
    this.values = explorer.parameters.map((parameter) => parameter.values.map((value) => [...value]));
    this.makeControls();
    if (changed) this.compile();
    this.draw();
  },

  fail(message) {
    this.program = null;
    byId('explorer-failure').textContent = message;
    byId('explorer-failure').hidden = false;
    byId('spheres').hidden = true;
  },

  compile() {
    const gl = this.gl ??= byId('spheres').getContext('webgl2', { antialias: false });
    if (!gl) return this.fail('This browser offers no WebGL 2, which the spheres are drawn with.');
    const program = gl.createProgram();
    const sources = [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, fragmentShader(this.text, this.explorer.model)]];
    for (const [type, source] of sources) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) return this.fail(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return this.fail(gl.getProgramInfoLog(program));
    if (this.program) gl.deleteProgram(this.program);
    this.program = program;
    byId('explorer-failure').hidden = true;
    byId('spheres').hidden = false;
  },

  /** Spheres across, and their side in CSS pixels. */
  layout() {
    const count = this.explorer.spheres.length;
    const width = Math.min(byId('spheres').parentElement.clientWidth, 960);
    const across = Math.min(count, Math.max(1, Math.floor(width / 130)));
    return { across, down: Math.ceil(count / across), side: Math.floor(Math.min(width / across, 360)) };
  },

  draw() {
    byId('light-theta-value').textContent = byId('light-theta').value;
    byId('light-phi-value').textContent = byId('light-phi').value;
    byId('exposure-value').textContent = byId('exposure').value.replace('-', '−');
    if (!this.program) return;
    const gl = this.gl, canvas = byId('spheres'), { across, down, side } = this.layout();
    const pixels = Math.round(side * (window.devicePixelRatio || 1));
    canvas.width = across * pixels;
    canvas.height = down * pixels;
    canvas.style.width = `${across * side}px`;
    byId('captions').style.cssText = `grid-template-columns: repeat(${across}, 1fr); width: ${across * side}px`;
    byId('captions').replaceChildren(...this.explorer.spheres.map((label) => make('span', {}, label)));
    gl.useProgram(this.program);
    const at = (name) => gl.getUniformLocation(this.program, name);
    const theta = byId('light-theta').value * Math.PI / 180, phi = byId('light-phi').value * Math.PI / 180;
    gl.uniform3f(at('light'), Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta));
    gl.uniform1f(at('exposure'), 2 ** byId('exposure').value);
    gl.uniform1f(at('side'), pixels);
    this.explorer.spheres.forEach((_, sphere) => {
      const left = sphere % across * pixels, bottom = (down - 1 - Math.floor(sphere / across)) * pixels;
      gl.viewport(left, bottom, pixels, pixels);
      gl.uniform2f(at('corner'), left, bottom);
      this.explorer.parameters.forEach((parameter, k) => {
        const value = this.values[k][sphere], place = at(`parameters.${parameter.name}`);
        if (value.length === 3) gl.uniform3f(place, ...value);
        else gl.uniform1f(place, value[0]);
      });
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    });
  },

  /** The light goes where the sphere under the pointer would face it: its edge is 90° from the viewer. */
  turn(event) {
    const box = byId('spheres').getBoundingClientRect(), { side } = this.layout();
    const scale = side * this.layout().across / box.width;
    const x = (event.clientX - box.left) * scale, y = (event.clientY - box.top) * scale;
    const within = (v) => 2 * (v - side * Math.floor(v / side)) / side - 1;
    const right = within(x), up = -within(y);
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
