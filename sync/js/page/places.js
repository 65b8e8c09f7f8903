// Positions of a replica's nodes in the world. Each place of a node has its own way from the root (USE makes several)
// with the transforms on it. Ways are searched again when nodes get other parents; positions are computed when needed.
//
// Matrices are 16 numbers in column order and transform column vectors: (x, y, z) below is at m (x, y, z, 1).

const SFNODE = 12, MFNODE = 13;
const kMostDeep = 64, kMostVisits = 100_000;  // a few lines of USE may repeat without end
/** The fields with further nodes of the world: without the proxy of a Collision, with one child of a Switch, and the
 * first level of an LOD. */
const kHolding = ['children', 'layers', 'skeleton'];

/** Returns a field's value by name, or `otherwise` if the type has no such field or another kind of value. */
export function fieldOr(node, name, otherwise) {
  const index = node.type.fields.findIndex((f) => f.name === name && !f.hidden);
  const value = index >= 0 ? node.values[index] ?? node.type.fields[index].default : undefined;
  if (typeof value !== typeof otherwise) return otherwise;
  return typeof value === 'number' && !Number.isFinite(value) ? otherwise : value;
}
/** The same for nodes that a field refers to. */
export function childrenOf(node, name, hidden = false) {
  const index = node.type.fields.findIndex((f) => f.name === name && f.hidden === hidden);
  const value = index >= 0 ? node.values[index] : undefined;
  return typeof value === 'number' ? [value] : value ?? [];
}
/** Returns the node itself, or for a PROTO's instance the first node of its body. */
export function standIn(scene, id) {
  for (let depth = 0; depth < kMostDeep; ++depth) {
    const node = scene.nodes.get(id);
    if (!node || node.type.kind === 'built in' || node.type.kind === 'Script') return node;
    [id] = childrenOf(node, 'body', true);
  }
  return undefined;
}

export function times(a, b) {
  const m = new Array(16).fill(0);
  for (let column = 0; column < 4; ++column)
    for (let row = 0; row < 4; ++row)
      for (let k = 0; k < 4; ++k) m[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return m;
}
export const identity = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const moved = ([x, y, z], sign = 1) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, sign * x, sign * y, sign * z, 1];
const scaled = ([x, y, z]) => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
function turned([x, y, z, angle], sign = 1) {
  const length = Math.hypot(x, y, z), c = Math.cos(angle), s = sign * Math.sin(angle), t = 1 - c;
  if (!(length > 0)) return identity();
  [x, y, z] = [x / length, y / length, z / length];
  return [t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0, t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0,
    t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0, 0, 0, 0, 1];
}
/** The matrix of a Transform or a node with the same fields (19775-1, 10.4.4); null for nodes that move nothing. */
export function transformOf(node) {
  const translation = fieldOr(node, 'translation', null), rotation = fieldOr(node, 'rotation', null), scale = fieldOr(node, 'scale', null);
  if (translation?.length !== 3 || rotation?.length !== 4 || scale?.length !== 3) return null;
  const center = fieldOr(node, 'center', []), orientation = fieldOr(node, 'scaleOrientation', []);
  let m = moved(translation);
  if (center.length === 3) m = times(m, moved(center));
  m = times(m, turned(rotation));
  if (orientation.length === 4) m = times(m, turned(orientation));
  m = times(m, scaled(scale));
  if (orientation.length === 4) m = times(m, turned(orientation, -1));
  return center.length === 3 ? times(m, moved(center, -1)) : m;
}
export function pointThrough(m, [x, y, z]) {
  return [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);
}
/** The point that is mapped to `point`; null if there is none, or all are. */
export function pointBefore(m, point) {
  const [a, b, c] = [0, 4, 8].map((at) => [m[at], m[at + 1], m[at + 2]]), p = point.map((x, i) => x - m[12 + i]);
  const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2], volume = dot(a, cross(b, c));
  const result = [dot(p, cross(b, c)), dot(a, cross(p, c)), dot(a, cross(b, p))].map((x) => x / volume);
  return result.every(Number.isFinite) ? result : null;
}

export class Places {
  /** Finds the places of nodes of these types. */
  constructor(scene, types) {
    this.scene = scene;
    this.types = new Set(types);
    this.ways = [];
    this.isStale = true;
  }
  /** `changed` is the argument of a Scene's listener. */
  change(changed) {
    for (let i = 0; i < changed.length && !this.isStale; i += 2) {
      const def = changed[i].type.fields[changed[i + 1]];
      this.isStale = def.type === SFNODE || def.type === MFNODE || def.name === 'whichChoice' || def.name === 'visible';
    }
  }
  /** Sets this.ways: [{key, node, way}]. `way` has the nodes above that may move it; `key` is always the same for the
   * same place. */
  find() {
    this.isStale = false;
    this.ways = [];
    this.visits = 0;
    this.down(this.scene.root, [], '');
  }
  down(node, way, key) {
    if (!node || way.length > kMostDeep || ++this.visits > kMostVisits) return;
    if (this.types.has(node.type.name)) {
      this.ways.push({key, node, way});
      return;
    }
    if (!fieldOr(node, 'visible', true)) return;
    for (const id of this.below(node)) {
      const child = standIn(this.scene, id);
      this.down(child, child ? [...way, child] : way, `${key}/${id}`);
    }
  }
  below(node) {
    if (node.type.name === 'Inline') return childrenOf(node, 'body', true);
    const all = kHolding.flatMap((name) => Array.from(childrenOf(node, name)));
    if (node.type.name === 'Switch') return all.slice(fieldOr(node, 'whichChoice', -1)).slice(0, fieldOr(node, 'whichChoice', -1) < 0 ? 0 : 1);
    return node.type.name === 'LOD' ? all.slice(0, 1) : all;
  }
  worldFromLocal({way}) {
    return way.reduce((m, node) => {
      const own = transformOf(node);
      return own ? times(m, own) : m;
    }, identity());
  }
}
