// BRDFs on the graphics card: the row's exported GLSL and the slices' reference, in one program.
//
// The text is that of `lobefit export`, unchanged: it is GLSL 4.50 and OpenGL ES 3.00 at once, but for the precision
// that stands before it. World and samples of a sphere are those of `lobefit sphere`: x right, y up, z towards the
// viewer, four samples per pixel, π f cos under one white light, 8-bit sRGB. The reference is a table over polar angles,
// linear between them and across the normal, beyond the last angle as there.

const vertexShader = `#version 300 es
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}`;

const fragmentShader = (text, model) => `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
${text}
uniform Lobefit_${model}_Parameters parameters;
uniform int shown;         // 0: the model, 1: the reference, 2: the model minus the reference
uniform int view;          // 0: a lit sphere, 1: values around a lobe, 2: an image slice
uniform sampler3D entries; // over phi, theta_i, theta_o: rgb, and 0 where masked
uniform sampler2D angles;  // lines of phi, theta_i, theta_o in degrees
uniform ivec3 counts;      // of angles in each line
uniform vec3 light;
uniform float exposure;
uniform float theta_i;
uniform float side;
uniform bool square_root;
uniform vec3 low, middle, high;
out vec4 colour;

vec2 place(int axis, float angle) {
    int count = counts[axis], cell = 0;
    if (count < 2) return vec2(0.0);
    while (cell < count - 2 && texelFetch(angles, ivec2(cell + 1, axis), 0).r <= angle) ++cell;
    float below = texelFetch(angles, ivec2(cell, axis), 0).r, above = texelFetch(angles, ivec2(cell + 1, axis), 0).r;
    return vec2(float(cell), clamp((angle - below) / (above - below), 0.0, 1.0));
}

vec3 between_entries(float azimuth, vec2 polar) {
    vec2 phi = place(0, azimuth), i = place(1, polar.x), o = place(2, polar.y);
    vec4 sum = vec4(0.0);
    for (int corner = 0; corner < 8; ++corner) {
        ivec3 bit = ivec3(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
        vec3 fraction = vec3(phi.y, i.y, o.y);
        vec3 share = mix(1.0 - fraction, fraction, vec3(bit));
        ivec3 cell = min(ivec3(phi.x, i.x, o.x) + bit, counts - 1);
        vec4 entry = texelFetch(entries, cell, 0);
        sum += share.x * share.y * share.z * vec4(entry.rgb * entry.a, entry.a);
    }
    return sum.a > 0.0 ? sum.rgb / sum.a : vec3(0.0);
}

/** Nearer to the normal than the table's first angle: linear to the same angle beyond the normal. */
vec3 reference(vec3 wi, vec3 wo) {
    float sine = wi.x * wo.y - wi.y * wo.x, cosine = dot(wi.xy, wo.xy);
    float azimuth = sine == 0.0 && cosine == 0.0 ? 0.0 : degrees(abs(atan(sine, cosine)));
    vec2 polar = degrees(vec2(atan(length(wi.xy), wi.z), atan(length(wo.xy), wo.z)));
    vec2 first = vec2(texelFetch(angles, ivec2(0, 1), 0).r, texelFetch(angles, ivec2(0, 2), 0).r);
    vec2 near = 0.5 + 0.5 * clamp(polar / max(first, 1e-6), 0.0, 1.0);
    float share = near.x * near.y + (1.0 - near.x) * (1.0 - near.y);
    vec3 f = between_entries(azimuth, polar);
    return share < 1.0 ? mix(between_entries(180.0 - azimuth, polar), f, share) : f;
}

vec3 value(vec3 wi, vec3 wo) {
    vec3 f = vec3(0.0);
    if (shown != 1) f = Lobefit_${model}(wi, wo, parameters);
    if (shown != 0) f = shown == 1 ? reference(wi, wo) : f - reference(wi, wo);
    return f;
}

float luminance(vec3 linear) { return dot(linear, vec3(0.2126, 0.7152, 0.0722)); }

vec3 encode(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(1.055 * pow(max(c, 1e-6), vec3(1.0 / 2.4)) - 0.055, 12.92 * c, vec3(lessThanEqual(c, vec3(0.0031308))));
}

/** Radiance as an sRGB colour; a difference as a colour between two, full at a quarter. */
vec3 picture(vec3 radiance) {
    if (shown != 2) return encode(exposure * radiance);
    float size = clamp(4.0 * exposure * luminance(radiance), -1.0, 1.0);
    return mix(middle, size < 0.0 ? low : high, abs(size));
}

vec4 sphere() {
    vec3 sum = vec3(0.0);
    float cover = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec2 at = gl_FragCoord.xy + vec2(float(k % 2) * 0.5 - 0.25, float(k / 2) * 0.5 - 0.25);
        vec2 p = 2.0 * at / side - 1.0;
        float radius2 = dot(p, p);
        if (radius2 >= 1.0) continue;
        vec3 z = vec3(p, sqrt(1.0 - radius2));
        vec3 x = normalize(vec3(z.z, 0.0, -z.x));
        mat3 frame = mat3(x, cross(z, x), z);
        vec3 wi = light * frame;
        cover += 1.0;
        if (wi.z > 0.0) sum += value(wi, vec3(0.0, 0.0, 1.0) * frame) * wi.z;
    }
    vec3 radiance = cover > 0.0 ? 3.14159265 * sum / cover : vec3(0.0);
    return vec4(picture(radiance), 1.0) * (cover / 4.0);
}

/** The bytes of π f cos theta_o as a float: light from the left, theta_o from -89.5 to 89.5 degrees. */
vec4 lobe() {
    float theta = radians(floor(gl_FragCoord.x) - 89.5);
    vec3 wi = vec3(-sin(theta_i), 0.0, cos(theta_i)), wo = vec3(sin(theta), 0.0, cos(theta));
    uint bits = floatBitsToUint(3.14159265 * luminance(value(wi, wo)) * wo.z);
    return vec4(uvec4(bits, bits >> 8, bits >> 16, bits >> 24) & 255u) / 255.0;
}

/** theta_h to the right, theta_d upwards, 0 to 90 degrees each; phi_d = 90 degrees: wi and wo mirror each other. */
vec4 image() {
    vec2 share = gl_FragCoord.xy / side;
    vec2 angle = radians(90.0 * vec2(square_root ? share.x * share.x : share.x, share.y));
    vec3 d = vec3(0.0, sin(angle.y), cos(angle.y));
    vec3 wi = vec3(sin(angle.x) * d.z, d.y, cos(angle.x) * d.z);
    return vec4(picture(1.57079633 * value(wi, vec3(wi.x, -wi.y, wi.z))), 1.0);
}

void main() { colour = view == 0 ? sphere() : view == 1 ? lobe() : image(); }`;

const views = { sphere: 0, lobe: 1, image: 2 };
const shows = { model: 0, reference: 1, difference: 2 };
const lobeAngles = Array.from({ length: 180 }, (_, k) => k - 89.5);

/** One hidden canvas draws all; pictures are copied from it. */
const brdfs = {
  textures: [],

  /** Null, or why nothing can be drawn. */
  compile(text, model) {
    this.canvas ??= make('canvas');
    const gl = this.gl ??= this.canvas.getContext('webgl2', { antialias: false });
    if (!gl) return 'This browser offers no WebGL 2, which the spheres are drawn with.';
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, fragmentShader(text, model)]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) return gl.getShaderInfoLog(shader);
      gl.attachShader(program, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return gl.getProgramInfoLog(program);
    if (this.program) gl.deleteProgram(this.program);
    this.program = program;
    gl.disable(gl.DITHER);
    gl.useProgram(program);
    gl.uniform1i(this.at('entries'), 0);
    gl.uniform1i(this.at('angles'), 1);
    return null;
  },

  at(name) { return this.gl.getUniformLocation(this.program, name); },

  texture(unit, target) {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(target, this.textures[unit] ??= gl.createTexture());
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, name, gl.NEAREST);
  },

  /** The reference of one parameter row; without slices a table of nothing. */
  setReference(slices, row) {
    const gl = this.gl, axes = slices ? [slices.phi, slices.theta_i, slices.theta_o] : [[0], [0], [0]];
    const counts = axes.map((axis) => axis.length), values = new Float32Array(4 * counts[0] * counts[1] * counts[2]);
    for (let o = 0, at = 0; slices && o < counts[2]; ++o) {
      for (let i = 0; i < counts[1]; ++i) {
        for (let p = 0; p < counts[0]; ++p, at += 4) {
          for (let c = 0; c < 3; ++c) {
            const place = { channel: slices.channels > 1 ? c : 0, row, thetaO: o, thetaI: i, phi: p };
            const value = slices.reference[slices.index(place)];
            if (Number.isFinite(value)) values[at + c] = value;
            values[at + 3] = Number.isFinite(value) ? 1 : 0;
          }
        }
      }
    }
    const longest = Math.max(...counts), lines = new Float32Array(3 * longest);
    axes.forEach((axis, k) => lines.set(axis, k * longest));
    this.texture(0, gl.TEXTURE_3D);
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA32F, ...counts, 0, gl.RGBA, gl.FLOAT, values);
    this.texture(1, gl.TEXTURE_2D);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, longest, 3, 0, gl.RED, gl.FLOAT, lines);
    gl.uniform3i(this.at('counts'), ...counts);
  },

  /** One picture of the hidden canvas; `values` as [parameter][component]. */
  run(view, shown, parameters, values, uniforms, width, height) {
    const gl = this.gl;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.uniform1i(this.at('view'), views[view]);
    gl.uniform1i(this.at('shown'), shows[shown]);
    for (const [name, value] of Object.entries(uniforms)) {
      if (Array.isArray(value)) gl.uniform3f(this.at(name), ...value);
      else gl.uniform1f(this.at(name), value);
    }
    parameters.forEach((parameter, k) => {
      const place = this.at(`parameters.${parameter.name}`);
      if (values[k].length === 3) gl.uniform3f(place, ...values[k]);
      else gl.uniform1f(place, values[k][0]);
    });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  },

  /** Into a canvas of the page, `side` CSS pixels wide. */
  draw(canvas, side, view, shown, parameters, values, uniforms) {
    const pixels = Math.max(1, Math.round(side * (window.devicePixelRatio || 1)));
    this.run(view, shown, parameters, values, { ...uniforms, side: pixels }, pixels, pixels);
    canvas.width = canvas.height = pixels;
    canvas.getContext('2d').drawImage(this.canvas, 0, 0);
  },

  /** π f cos theta_o at lobeAngles. */
  lobe(shown, parameters, values, thetaI) {
    const gl = this.gl, bytes = new Uint8Array(4 * lobeAngles.length);
    this.run('lobe', shown, parameters, values, { theta_i: thetaI }, lobeAngles.length, 1);
    gl.readPixels(0, 0, lobeAngles.length, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return [...new Float32Array(bytes.buffer)];
  },
};
