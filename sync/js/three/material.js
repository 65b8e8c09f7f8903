// X3D's appearances as materials of three.js, and textures.
//
// Material and UnlitMaterial are computed in the display's space, as all browsers of X3D do: what they give is written as it is.
// PhysicalMaterial is linear, and encoded as three.js encodes it. Light of intensity 1 that meets a white Material head-on
// makes it white, which is a light of pi for three.js.

import {
  BackSide, ClampToEdgeWrapping, Color, DataTexture, DoubleSide, FrontSide, LineBasicMaterial, MeshBasicMaterial, MeshPhongMaterial,
  MeshStandardMaterial, NoColorSpace, PointsMaterial, RepeatWrapping, SRGBColorSpace, ShaderChunk, Texture, TextureLoader,
} from 'three';

/** Colours of X3D, which three.js shall not convert. */
export const raw = (color, [r, g, b]) => color.setRGB(r, g, b, 'srgb-linear');

const kEncode = '#include <colorspace_fragment>';
/** Attenuations of X3D have three numbers, lights of three.js one power. Beside the power that comes nearest, for materials of others, the ratios
 * of the three are packed into `distance` as a negative number, which three.js takes for none, and the materials here for both. */
const kSteps = 4096, kPerOctave = 128, kLowest = -16;
const packRatio = (ratio) => ratio > 0 ? Math.min(kSteps - 1, Math.max(1, Math.round((Math.log2(ratio) - kLowest) * kPerOctave))) : 0;
export function attenuate(light, [constant, linear, square], meant = 5) {
  const one = constant || 1e-3 * Math.max(linear, square) || 1, b = linear / one, c = square / one;
  light.intensity /= one;
  light.decay = Math.log(1 + b * meant + c * meant * meant) / Math.log(meant);
  light.distance = -1 - packRatio(b) * kSteps - packRatio(c);
}
const kLights = ShaderChunk.lights_pars_begin.replace(/float getDistanceAttenuation\([^)]*\) \{/, `float rtsgRatio(float packed) {
  return packed < 0.5 ? 0.0 : exp2(packed / ${kPerOctave}.0 + ${kLowest}.0);
}
$&
  if (cutoffDistance < 0.0) {
    float rtsgPacked = -1.0 - cutoffDistance, rtsgLinear = floor(rtsgPacked / ${kSteps}.0);
    return 1.0 / (1.0 + lightDistance * (rtsgRatio(rtsgLinear) + lightDistance * rtsgRatio(rtsgPacked - ${kSteps}.0 * rtsgLinear)));
  }`);
/** X3D's highlight: no Fresnel, and no share that grows with the exponent (17.2.2.5). Ambient light counts by the material's ambientIntensity. */
const kPhong = `uniform float rtsgAmbient;
${ShaderChunk.lights_phong_pars_fragment.replace(/reflectedLight\.directSpecular \+=[^;]*;/, `reflectedLight.directSpecular += directLight.color * RECIPROCAL_PI *
    material.specularColor * material.specularStrength * step(0.0, dotNL) *
    pow(saturate(dot(geometryNormal, normalize(directLight.direction + geometryViewDir))), material.specularShininess);`)
    .replace(/reflectedLight\.indirectDiffuse \+=/, '$& rtsgAmbient *')}`;

/** A PhysicalMaterial divides scattered light by pi (17.2.2.5), and lights have been multiplied by it. */
const kPhysical = `reflectedLight.directDiffuse *= RECIPROCAL_PI;
  reflectedLight.directSpecular *= RECIPROCAL_PI;
  reflectedLight.indirectDiffuse *= rtsgAmbient;
  $&`;

/** The material's shader knows X3D's lights; unless it is `linear`, it writes what it has computed, unencoded. */
function asInX3D(material, linear = false) {
  material.userData.ambient = {value: 0};
  material.onBeforeCompile = (shader) => {
    shader.uniforms.rtsgAmbient = material.userData.ambient;
    let text = shader.fragmentShader.replace('#include <lights_pars_begin>', () => (linear ? 'uniform float rtsgAmbient;\n' : '') + kLights).replace('#include <lights_phong_pars_fragment>', () => kPhong);
    text = linear ? text.replace('vec3 totalDiffuse =', kPhysical) : text.replace(kEncode, '');
    shader.fragmentShader = text;
  };
  material.customProgramCacheKey = () => `rtsg ${linear}`;
  return material;
}

const kTextures = {map: ['diffuseTexture', 'baseTexture'], normalMap: ['normalTexture'], emissiveMap: ['emissiveTexture'], specularMap: ['specularTexture'],
  aoMap: ['occlusionTexture'], roughnessMap: ['metallicRoughnessTexture'], metalnessMap: ['metallicRoughnessTexture']};
/** Which textures hold colours that are encoded, where the material is linear. */
const kEncoded = new Set(['map', 'emissiveMap']);

/** What decides which class of material a shape has, as text: one that changes asks for another material. */
export function kindOf(shape, child) {
  const appearance = child(shape.node, 'appearance'), material = appearance && child(appearance, 'material');
  const physical = material?.type.name === 'PhysicalMaterial', lit = material && material.type.name !== 'UnlitMaterial';
  const base = shape.kind !== 'triangles' ? shape.kind : physical ? 'physical' : lit ? 'phong' : 'unlit';
  const solid = shape.solid ? shape.ccw ? 'front' : 'back' : 'both';
  return `${base} ${shape.color ? `${shape.lanes} colours` : 'plain'} ${solid}`;
}

export function makeMaterial(kind) {
  const [base, colors] = kind.split(' '), vertexColors = colors !== 'plain';
  const side = kind.endsWith('both') ? DoubleSide : kind.endsWith('back') ? BackSide : FrontSide;
  switch (base) {
  case 'lines': return asInX3D(new LineBasicMaterial({vertexColors}));
  case 'points': return asInX3D(new PointsMaterial({vertexColors, sizeAttenuation: false, size: 1}));
  case 'physical': return asInX3D(new MeshStandardMaterial({vertexColors, side}), true);
  case 'phong': return asInX3D(new MeshPhongMaterial({vertexColors, side}));
  default: return asInX3D(new MeshBasicMaterial({vertexColors, side}));
  }
}

/** Sets everything of a material as the nodes say. `texture(node, transform, encoded)` is a texture of three.js; it is asked for all
 * that the material has, each time. */
export function fillMaterial(made, kind, appearance, child, texture) {
  const node = appearance && child(appearance, 'material'), get = (name, otherwise) => node && node.type.fields.some((f) => f.name === name) ? node.get(name) : otherwise;
  const base = kind.split(' ')[0], colored = !kind.includes('plain'), alphas = kind.includes('4 colours');
  const lit = base === 'phong' || base === 'physical', white = [1, 1, 1];
  // Lines and points are drawn in the emissive colour; a shape without a material is white.
  const main = base === 'phong' ? get('diffuseColor', white) : base === 'physical' ? get('baseColor', white) : get('emissiveColor', white);
  raw(made.color, colored ? white : main);
  if (lit) raw(made.emissive, get('emissiveColor', [0, 0, 0]));
  if (base === 'phong') {
    raw(made.specular, get('specularColor', [0, 0, 0]));
    made.userData.ambient.value = get('ambientIntensity', 0.2);
    made.shininess = 128 * get('shininess', 0.2);
  } else if (base === 'physical') {
    made.metalness = get('metallic', 1);
    made.roughness = get('roughness', 1);
  }
  const encoded = base === 'physical', chosen = {};
  for (const [slot, names] of Object.entries(kTextures)) {
    if (!(slot in made)) continue;
    let from = null;
    for (const name of [...names, ...(slot === 'map' && base === 'unlit' ? ['emissiveTexture'] : [])]) from ??= node && child(node, name);
    if (slot === 'map') from ??= appearance && child(appearance, 'texture');
    chosen[slot] = from ? texture(from, appearance && child(appearance, 'textureTransform'), encoded && kEncoded.has(slot)) : null;
  }
  for (const [slot, value] of Object.entries(chosen)) {
    if (Boolean(made[slot]) !== Boolean(value)) made.needsUpdate = true;  // another shader
    made[slot] = value;
  }
  if (made.normalMap) made.normalScale.setScalar(get('normalScale', 1));
  const alphaMode = appearance?.get('alphaMode') ?? 'AUTO', opacity = 1 - get('transparency', 0);
  made.opacity = alphaMode === 'OPAQUE' ? 1 : opacity;
  const masked = alphaMode === 'MASK' ? appearance.get('alphaCutoff') : 0;
  const blended = alphaMode === 'BLEND' || (alphaMode === 'AUTO' && (opacity < 1 || alphas || made.map?.userData.alpha === true));
  if (made.transparent !== blended || made.alphaTest !== masked) made.needsUpdate = true;
  made.transparent = blended;
  made.alphaTest = masked;
  made.depthWrite = !blended;
}

const loader = new TextureLoader();

/** A texture of a node; null for types that are not shown. Calls `done` when its picture has come, or has not. */
export function makeTexture(node, encoded, pictureUrl, done) {
  const made = node.type.name === 'PixelTexture' ? fromPixels(node.get('image')) : node.type.name === 'ImageTexture' ? new Texture() : null;
  if (!made) return null;
  made.wrapS = node.get('repeatS') ? RepeatWrapping : ClampToEdgeWrapping;
  made.wrapT = node.get('repeatT') ? RepeatWrapping : ClampToEdgeWrapping;
  made.colorSpace = encoded ? SRGBColorSpace : NoColorSpace;
  made.matrixAutoUpdate = false;
  if (node.type.name === 'PixelTexture') return made;
  const urls = node.get('url');
  const attempt = (i) => {
    const url = i < urls.length && pictureUrl(node.id, i, urls[i]);
    if (i >= urls.length) return done(new Error(`${node.type.name} ${node.id}: no picture`));
    if (!url) return attempt(i + 1);
    return loader.load(url, ({image}) => {
      made.image = image;
      made.needsUpdate = true;
      made.userData.alpha = hasAlpha(image);
      done(null);
    }, undefined, () => attempt(i + 1));
  };
  if (urls.length) attempt(0);
  return made;
}

function fromPixels([width = 0, height = 0, lanes = 0, ...pixels]) {
  if (width * height > pixels.length) width = height = 0;  // it says more than it has
  const data = new Uint8Array(4 * width * height);
  pixels.slice(0, width * height).forEach((pixel, i) => {
    const bytes = [24, 16, 8, 0].map((shift) => pixel >>> shift & 255).slice(4 - lanes);
    const [r, g, b, a] = lanes < 3 ? [bytes[0], bytes[0], bytes[0], bytes[1] ?? 255] : [...bytes, 255];
    data.set([r, g, b, a], 4 * i);
  });
  const made = new DataTexture(width && height ? data : new Uint8Array([255, 255, 255, 255]), width || 1, height || 1);
  made.userData.alpha = lanes === 2 || lanes === 4;
  made.needsUpdate = true;
  return made;
}

/** Whether any pixel lets through: only then is what has the picture sorted and blended. */
function hasAlpha(image) {
  const canvas = document.createElement('canvas');
  canvas.width = Math.min(image.width, 64);
  canvas.height = Math.min(image.height, 64);
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  try {
    const {data} = context.getImageData(0, 0, canvas.width, canvas.height);
    for (let i = 3; i < data.length; i += 4) if (data[i] < 255) return true;
  } catch { /* of another origin: nobody may look */ }
  return false;
}

/** -C × S × R × C × T of a TextureTransform (18.4.9); identity without one. */
export function setTextureMatrix(texture, node) {
  if (!node || node.type.name !== 'TextureTransform') return texture.matrix.identity();
  const [cx, cy] = node.get('center'), [sx, sy] = node.get('scale'), [tx, ty] = node.get('translation'), angle = node.get('rotation');
  const cos = Math.cos(angle), sin = Math.sin(angle), x = cx + tx, y = cy + ty;
  return texture.matrix.set(sx * cos, -sx * sin, sx * (cos * x - sin * y) - cx, sy * sin, sy * cos, sy * (sin * x + cos * y) - cy, 0, 0, 1);
}

/** A colour that is shown as it is, for a background. */
export const displayed = ([r, g, b]) => new Color().setRGB(r, g, b, SRGBColorSpace);
