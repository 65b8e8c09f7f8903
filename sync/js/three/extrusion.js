// Extrusion's points and faces (ISO/IEC 19775-1, 13.3.5): a cross section that is moved along a spine.

import {Matrix4, Quaternion, Vector3} from 'three';

const kMostPoints = 2_000_000;

const vectors = (list, size) => Array.from({length: Math.floor(list.length / size)}, (_, i) => list.slice(size * i, size * i + size));

/** Of each point of the spine, the axes x, y and z of its plane. */
function frames(spine) {
  const closed = spine.length > 2 && spine[0].distanceToSquared(spine.at(-1)) === 0, last = spine.length - 1;
  const at = (i) => closed ? spine[(i + last) % last] : spine[Math.max(0, Math.min(last, i))];
  const ys = spine.map((_, i) => closed || (i > 0 && i < last) ? at(i + 1).clone().sub(at(i - 1)) : i === 0 ? at(1).clone().sub(at(0)) : at(last).clone().sub(at(last - 1)));
  const zs = spine.map((p, i) => {
    if (!closed && (i === 0 || i === last)) return null;
    return at(i + 1).clone().sub(p).cross(at(i - 1).clone().sub(p));
  });
  const isZero = (v) => !v || v.lengthSq() < 1e-12;
  if (zs.every(isZero)) {
    // A straight spine: the axes of the scene, turned from y to the spine.
    const y = ys.find((v) => !isZero(v)) ?? new Vector3(0, 1, 0);
    const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), y.clone().normalize());
    zs.fill(new Vector3(0, 0, 1).applyQuaternion(turn));
  }
  const first = zs.find((v) => !isZero(v));
  let before = first;
  return spine.map((_, i) => {
    let z = isZero(zs[i]) ? before.clone() : zs[i].clone();
    if (z.dot(before) < 0) z.negate();
    before = z;
    const y = (isZero(ys[i]) ? new Vector3(0, 1, 0) : ys[i].clone()).normalize();
    z.normalize();
    const x = new Vector3().crossVectors(y, z).normalize();
    z = new Vector3().crossVectors(x, y);
    return [x, y, z];
  });
}

/** {points, texture, faces of {points, texture}}: numbers into both. */
export function extrude(node) {
  const section = vectors(node.get('crossSection'), 2), spine = vectors(node.get('spine'), 3).map((p) => new Vector3(...p));
  const scales = vectors(node.get('scale'), 2), turns = vectors(node.get('orientation'), 4);
  const points = [], texture = [], faces = [], n = section.length, rings = spine.length;
  if (n * rings > kMostPoints) throw new RangeError(`an Extrusion of ${n * rings} points`);
  if (n < 2 || rings < 2) return {points: new Float32Array(0), texture: new Float32Array(0), faces};
  const along = lengths(spine.map((p) => p.toArray())), across = lengths(section);
  frames(spine).forEach(([x, y, z], i) => {
    const scale = scales[Math.min(i, scales.length - 1)] ?? [1, 1], [a, b, c, angle] = turns[Math.min(i, turns.length - 1)] ?? [0, 0, 1, 0];
    const plane = new Matrix4().makeBasis(x, y, z);
    const turn = new Quaternion().setFromAxisAngle(new Vector3(a, b, c).normalize(), angle);
    section.forEach(([u, v], k) => {
      const point = new Vector3(u * scale[0], 0, v * scale[1]).applyQuaternion(turn).applyMatrix4(plane).add(spine[i]);
      points.push(...point.toArray());
      texture.push(across[k], along[i]);
    });
  });
  const isClosed = section[0].every((value, k) => value === section.at(-1)[k]);
  for (let i = 0; i + 1 < rings; ++i) {
    for (let k = 0; k + 1 < n; ++k) {
      const face = [i * n + k, i * n + k + 1, (i + 1) * n + k + 1, (i + 1) * n + k];
      // The seam of a closed section has points of its own number, so that normals are smooth over it.
      faces.push({points: face.map((p) => isClosed && p % n === n - 1 ? p - n + 1 : p), texture: face});
    }
  }
  const corners = isClosed ? n - 1 : n;
  const caps = section.map(([u, v]) => [u, v]), sides = [0, 1].map((k) => Math.max(...caps.map((p) => p[k])) - Math.min(...caps.map((p) => p[k])));
  const size = Math.max(...sides) || 1, low = [0, 1].map((k) => Math.min(...caps.map((p) => p[k])));
  for (const [wanted, ring, turned] of [['beginCap', 0, true], ['endCap', rings - 1, false]]) {
    if (!node.get(wanted) || corners < 3) continue;
    // A cap's points are its own: edges around it stay sharp.
    const firstPoint = points.length / 3, firstTexture = texture.length / 2;
    for (let k = 0; k < corners; ++k) {
      points.push(...points.slice(3 * (ring * n + k), 3 * (ring * n + k) + 3));
      texture.push((caps[k][0] - low[0]) / size, (caps[k][1] - low[1]) / size);
    }
    const order = Array.from({length: corners}, (_, k) => turned ? corners - 1 - k : k);
    faces.push({points: order.map((k) => firstPoint + k), texture: order.map((k) => firstTexture + k)});
  }
  return {points: Float32Array.from(points), texture: Float32Array.from(texture), faces};
}

/** The length up to each point, of the whole. */
function lengths(points) {
  const sums = [0];
  for (let i = 1; i < points.length; ++i) sums.push(sums[i - 1] + Math.hypot(...points[i].map((value, k) => value - points[i - 1][k])));
  return sums.map((sum) => sum / (sums.at(-1) || 1));
}
