// The gradients of a Background (24.4.1), as a ball around the camera that is drawn first and hides nothing.

import {BufferAttribute, BufferGeometry, Mesh} from 'three';

import {makeMaterial} from './material.js';

const kRound = 32, kFine = 4;  // steps around, and between two angles

/** The colour at an angle from the pole where `colors` begin. */
function colorAt(angle, colors, angles) {
  let i = 0;
  while (i < angles.length && angle > angles[i]) ++i;
  const take = (k) => Array.from(colors.slice(3 * k, 3 * k + 3));
  if (i >= angles.length || 3 * i + 3 >= colors.length) return take(Math.min(i, colors.length / 3 - 1));
  const from = i ? angles[i - 1] : 0, share = angles[i] > from ? (angle - from) / (angles[i] - from) : 1, next = take(i + 1);
  return take(i).map((c, k) => c + share * (next[k] - c));
}

/** A mesh, or null where one colour is all. */
export function makeSky(node) {
  const skies = node.get('skyColor'), skyAngles = Array.from(node.get('skyAngle')), grounds = node.get('groundColor'), groundAngles = Array.from(node.get('groundAngle'));
  if (skies.length < 6 && grounds.length < 3) return null;
  const horizon = grounds.length ? Math.PI - (groundAngles.at(-1) ?? 0) : Math.PI, position = [], color = [], index = [];
  const rings = (angles, from, to) => {
    const ends = [from, ...angles.filter((x) => x > from && x < to), to];
    return ends.flatMap((end, i) => i ? Array.from({length: kFine}, (_, k) => ends[i - 1] + (end - ends[i - 1]) * (k + 1) / kFine) : [end]);
  };
  const cap = (angles, colors, up) => {
    const first = position.length / 3;
    angles.forEach((angle) => {
      const shown = colorAt(angle, colors, up > 0 ? skyAngles : groundAngles);
      for (let k = 0; k <= kRound; ++k) {
        const around = 2 * Math.PI * k / kRound;
        position.push(Math.sin(angle) * Math.cos(around), up * Math.cos(angle), Math.sin(angle) * Math.sin(around));
        color.push(...shown);
      }
    });
    for (let i = 0; i + 1 < angles.length; ++i)
      for (let k = 0; k < kRound; ++k) {
        const at = first + i * (kRound + 1) + k, below = at + kRound + 1;
        index.push(at, at + 1, below, below, at + 1, below + 1);
      }
  };
  cap(rings(skyAngles, 0, horizon), skies, 1);
  if (grounds.length) cap(rings(groundAngles, 0, Math.PI - horizon), grounds, -1);
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(Float32Array.from(position), 3));
  geometry.setAttribute('color', new BufferAttribute(Float32Array.from(color), 3));
  geometry.setIndex(index);
  const material = makeMaterial('unlit 3 colours both');
  Object.assign(material, {depthTest: false, depthWrite: false, fog: false});
  const mesh = new Mesh(geometry, material);
  Object.assign(mesh, {frustumCulled: false, renderOrder: -1e9, raycast: () => {}});
  return mesh;
}
