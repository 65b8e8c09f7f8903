// X3D's geometry nodes as the arrays of a THREE.BufferGeometry: positions, normals, texture coordinates, colours.
//
// What has faces is gathered as polygons of corners, each a number of a point and of what is given beside it, and
// goes one way: triangles, normals by the crease angle, texture coordinates over the box where none are given.

import {BoxGeometry, ConeGeometry, CylinderGeometry, ShapeUtils, SphereGeometry, Vector2} from 'three';

import {extrude} from './extrusion.js';

/** How curved primitives are divided. */
const kAround = 32, kAcross = 16;
/** Faces around a point from which on all of them are smoothed together: to compare each with each would take too long. */
const kMostAround = 1000;
const kCrease = Math.PI;  // of types without a crease angle: all is smooth

/** A geometry's arrays: `kind` is triangles, lines or points. */
function made(kind, position, more = {}) {
  return {kind, position: Float32Array.from(position), ...more};
}

/** Numbers i, i + 1, … */
const count = (n) => Array.from({length: n}, (_, i) => i);

/** The lists of numbers between -1s. */
export function runs(indices) {
  const all = [];
  let run = [];
  for (const i of indices) {
    if (i >= 0) run.push(i);
    else if (run.length) all.push(run), run = [];
  }
  if (run.length) all.push(run);
  return all;
}

/** Fields of the nodes beside a geometry: of its Coordinate, Normal, Color and TextureCoordinate. */
class Given {
  constructor(node, child) {
    const get = (name, field) => {
      const found = child(node, name);
      return found ? found.get(field) : null;
    };
    this.points = get('coord', 'point') ?? new Float32Array(0);
    this.normals = get('normal', 'vector');
    this.colors = get('color', 'color');
    const colorNode = child(node, 'color');
    this.lanes = colorNode?.type.name === 'ColorRGBA' ? 4 : 3;
    let texture = child(node, 'texCoord');
    if (texture?.type.name === 'MultiTextureCoordinate') texture = child(texture, 'texCoord', 0);
    this.texture = texture?.type.name === 'TextureCoordinate' ? texture.get('point') : null;
    for (const name of ['normals', 'colors', 'texture']) if (!this[name]?.length) this[name] = null;
  }
}

/** A corner is [point, normal, colour, texture coordinate], by number. A run of indices without its partner takes that of the points. */
function cornersOf(faces, given, {normalRuns, colorRuns, textureRuns, normalPerVertex = true, colorPerVertex = true, normalOfFace, colorOfFace}) {
  return faces.map((face, f) => face.map((point, k) => [point,
    normalPerVertex ? normalRuns?.[f]?.[k] ?? point : normalOfFace?.[f] ?? f,
    colorPerVertex ? colorRuns?.[f]?.[k] ?? point : colorOfFace?.[f] ?? f,
    textureRuns?.[f]?.[k] ?? point]));
}

function faceNormal(face, points) {
  let x = 0, y = 0, z = 0;  // Newell's, which takes faces that are not flat or not convex
  for (let k = 0; k < face.length; ++k) {
    const a = 3 * face[k][0], b = 3 * face[(k + 1) % face.length][0];
    x += (points[a + 1] - points[b + 1]) * (points[a + 2] + points[b + 2]);
    y += (points[a + 2] - points[b + 2]) * (points[a] + points[b]);
    z += (points[a] - points[b]) * (points[a + 1] + points[b + 1]);
  }
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length, length];
}

/** Numbers of corners, three a triangle. */
function triangulate(face, points, normal, convex) {
  if (convex || face.length < 4) return face.slice(2).flatMap((_, k) => [0, k + 1, k + 2]);
  const [x, y, z] = normal.map(Math.abs), [u, v] = x > y && x > z ? [1, 2] : y > z ? [2, 0] : [0, 1];
  const flat = face.map(([p]) => new Vector2(points[3 * p + u], points[3 * p + v]));
  const flipped = normal[3 - u - v] < 0;  // triangulateShape turns what runs the other way round
  const found = ShapeUtils.triangulateShape(flat, []);
  return found.flatMap(([a, b, c]) => {
    const area = (flat[b].x - flat[a].x) * (flat[c].y - flat[a].y) - (flat[b].y - flat[a].y) * (flat[c].x - flat[a].x);
    return area < 0 === flipped ? [a, b, c] : [a, c, b];
  });
}

/** Of each corner of each face: the mean of the faces around its point that lean at most `crease` from its own. */
function creasedNormals(faces, points, crease) {
  const own = faces.map((face) => faceNormal(face, points)), around = new Map();
  faces.forEach((face, f) => face.forEach(([point]) => {
    if (!around.has(point)) around.set(point, []);
    around.get(point).push(f);
  }));
  const least = Math.cos(Math.min(crease, Math.PI)) - 1e-6, means = new Map();
  return faces.map((face, f) => face.map(([point]) => {
    if (crease <= 0) return own[f];
    const [a, b, c] = own[f], all = around.get(point), isEasy = crease >= Math.PI || all.length > kMostAround;
    if (isEasy && means.has(point)) return means.get(point);
    const sum = [0, 0, 0];
    for (const g of all) {
      const [x, y, z, weight] = own[g];
      if (g === f || isEasy || a * x + b * y + c * z >= least) sum[0] += weight * x, sum[1] += weight * y, sum[2] += weight * z;
    }
    const length = Math.hypot(...sum), mean = length > 0 ? sum.map((s) => s / length) : own[f];
    if (isEasy) means.set(point, mean);
    return mean;
  }));
}

/** Texture coordinates over the box of the points: the longest side is 0 to 1, the next one has the same scale. */
function boxCoordinates(points) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  points.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  const sides = high.map((h, k) => h - low[k]), [u, v] = [0, 1, 2].sort((a, b) => sides[b] - sides[a] || a - b), size = sides[u] || 1;
  return Float32Array.from({length: points.length / 3 * 2}, (_, i) => {
    const axis = i % 2 ? v : u;
    return (points[3 * (i >> 1) + axis] - low[axis]) / size;
  });
}

/** Triangles of polygons of corners. Faces with points that do not exist are left out. */
function polygons(corners, given, {crease = kCrease, convex = true, ccw = true, texture = given.texture} = {}) {
  const {points} = given, last = points.length / 3;
  const faces = corners.filter((face) => face.length > 2 && face.every(([point]) => point < last));
  const smooth = given.normals ? null : creasedNormals(faces, points, crease), coordinates = texture ?? boxCoordinates(points);
  const position = [], normal = [], uv = [], color = given.colors ? [] : null;
  const three = (from, i, into) => into.push(from[3 * i] ?? 0, from[3 * i + 1] ?? 0, from[3 * i + 2] ?? 0);
  faces.forEach((face, f) => {
    const order = triangulate(face, points, faceNormal(face, points), convex);
    for (let k = 0; k < order.length; ++k) {
      const at = ccw ? order[k] : order[k - k % 3 + (2 - k % 3)], [p, n, c, t] = face[at];
      three(points, p, position);
      if (smooth) normal.push(...smooth[f][at].slice(0, 3).map((x) => ccw ? x : -x));
      else three(given.normals, n, normal);
      uv.push(coordinates[2 * t] ?? 0, coordinates[2 * t + 1] ?? 0);
      for (let i = 0; color && i < given.lanes; ++i) color.push(given.colors[given.lanes * c + i] ?? 1);
    }
  });
  return made('triangles', position, {normal: Float32Array.from(normal), uv: Float32Array.from(uv), color: color && Float32Array.from(color), lanes: given.lanes});
}

// ---- types with faces ------------------------------------------------------------------------------------------------

function indexedFaceSet(node, child) {
  const given = new Given(node, child), faces = runs(node.get('coordIndex'));
  const perVertex = (name) => node.get(`${name}PerVertex`), own = (name) => node.get(name).length > 0;
  return polygons(cornersOf(faces, given, {
    normalPerVertex: perVertex('normal'), colorPerVertex: perVertex('color'),
    normalRuns: own('normalIndex') && runs(node.get('normalIndex')), normalOfFace: own('normalIndex') && node.get('normalIndex'),
    colorRuns: own('colorIndex') && runs(node.get('colorIndex')), colorOfFace: own('colorIndex') && node.get('colorIndex'),
    textureRuns: own('texCoordIndex') && runs(node.get('texCoordIndex')),
  }), given, {crease: node.get('creaseAngle'), convex: node.get('convex'), ccw: node.get('ccw')});
}

/** Triangles and quads with or without indices, in rows, strips and fans. */
const kFaces = {
  TriangleSet: (node, points) => count(points / 3 | 0).map((i) => [3 * i, 3 * i + 1, 3 * i + 2]),
  IndexedTriangleSet: (node) => chunks(node.get('index'), 3),
  QuadSet: (node, points) => chunks(count(points), 4),
  IndexedQuadSet: (node) => chunks(node.get('index'), 4),
  TriangleStripSet: (node, points) => counted(node.get('stripCount'), points).flatMap(strip),
  IndexedTriangleStripSet: (node) => runs(node.get('index')).flatMap(strip),
  TriangleFanSet: (node, points) => counted(node.get('fanCount'), points).flatMap(fan),
  IndexedTriangleFanSet: (node) => runs(node.get('index')).flatMap(fan),
};
function chunks(list, size) {
  return count(Math.floor(list.length / size)).map((i) => Array.from(list.slice(size * i, size * i + size)));
}
/** Rows of so many points each, as far as there are points. */
function counted(counts, points) {
  let at = 0;
  return Array.from(counts, (n) => count(Math.max(0, Math.min(n, points - at))).map(() => at++));
}
function strip(run) {
  return run.slice(2).map((_, k) => k % 2 ? [run[k + 1], run[k], run[k + 2]] : [run[k], run[k + 1], run[k + 2]]);
}
function fan(run) {
  return run.slice(2).map((_, k) => [run[0], run[k + 1], run[k + 2]]);
}
function faceSet(node, child) {
  const given = new Given(node, child), faces = kFaces[node.type.name](node, given.points.length / 3);
  const perVertex = node.get('normalPerVertex');
  return polygons(cornersOf(faces, given, {normalPerVertex: perVertex, colorPerVertex: true}), given,
    {crease: perVertex ? kCrease : 0, ccw: node.get('ccw')});
}

function elevationGrid(node, child) {
  const given = new Given(node, child), height = node.get('height');
  const nx = node.get('xDimension'), nz = node.get('zDimension'), dx = node.get('xSpacing'), dz = node.get('zSpacing');
  if (!(nx > 1 && nz > 1) || height.length < nx * nz) return made('triangles', []);
  given.points = Float32Array.from({length: 3 * nx * nz}, (_, i) => {
    const at = Math.floor(i / 3), x = at % nx, z = Math.floor(at / nx);
    return [dx * x, height[at], dz * z][i % 3];
  });
  const texture = given.texture ?? Float32Array.from({length: 2 * nx * nz}, (_, i) => i % 2 ? Math.floor((i >> 1) / nx) / (nz - 1) : (i >> 1) % nx / (nx - 1));
  const faces = [];
  for (let z = 0; z + 1 < nz; ++z)
    for (let x = 0; x + 1 < nx; ++x) faces.push([z * nx + x, (z + 1) * nx + x, (z + 1) * nx + x + 1, z * nx + x + 1]);
  return polygons(cornersOf(faces, given, {normalPerVertex: node.get('normalPerVertex'), colorPerVertex: node.get('colorPerVertex')}), given,
    {crease: node.get('creaseAngle'), ccw: node.get('ccw'), texture});
}

function extrusion(node) {
  const {points, faces, texture} = extrude(node);
  const corners = faces.map(({points: p, texture: t}) => p.map((point, k) => [point, point, point, t[k]]));
  return polygons(corners, {points, normals: null, colors: null, lanes: 3}, {crease: node.get('creaseAngle'), convex: node.get('convex'), ccw: node.get('ccw'), texture});
}

/** What three.js makes, without the parts whose groups are left out. */
function primitive(geometry, kept = () => true) {
  const {index, attributes} = geometry, chosen = geometry.groups.length ? geometry.groups.filter(kept) : [{start: 0, count: index.count}];
  const corners = chosen.flatMap(({start, count: n}) => Array.from(index.array.slice(start, start + n)));
  const take = (from, size) => Float32Array.from({length: size * corners.length}, (_, i) => from.array[size * corners[Math.floor(i / size)] + i % size]);
  return made('triangles', take(attributes.position, 3), {normal: take(attributes.normal, 3), uv: take(attributes.uv, 2)});
}
/** Seams are at the back, and coordinates run counterclockwise from above (13.3.3, 13.3.4, 13.3.8). */
const kBack = Math.PI;
const kPrimitives = {
  Box: (node) => primitive(new BoxGeometry(...node.get('size'))),
  Sphere: (node) => primitive(new SphereGeometry(node.get('radius'), kAround, kAcross).rotateY(-Math.PI / 2)),
  Cylinder: (node) => primitive(new CylinderGeometry(node.get('radius'), node.get('radius'), node.get('height'), kAround, 1, false, kBack),
    ({materialIndex}) => node.get(['side', 'top', 'bottom'][materialIndex])),
  Cone: (node) => primitive(new ConeGeometry(node.get('bottomRadius'), node.get('height'), kAround, 1, false, kBack),
    ({materialIndex}) => node.get(materialIndex ? 'bottom' : 'side')),
};

// ---- lines, points and what is flat ------------------------------------------------------------------------------------

function lines(list, given, colorAt = (p) => p) {
  const position = [], color = given.colors ? [] : null, last = given.points.length / 3;
  list.forEach((run, r) => {
    for (let k = 1; k < run.length; ++k) {
      if (run[k - 1] >= last || run[k] >= last) continue;
      for (const at of [k - 1, k]) {
        const p = run[at], c = colorAt(p, r, at);
        position.push(...given.points.subarray(3 * p, 3 * p + 3));
        for (let i = 0; color && i < given.lanes; ++i) color.push(given.colors[given.lanes * c + i] ?? 1);
      }
    }
  });
  return made('lines', position, {color: color && Float32Array.from(color), lanes: given.lanes});
}
function indexedLineSet(node, child) {
  const index = node.get('colorIndex'), own = index.length > 0, inRuns = own ? runs(index) : null;
  return lines(runs(node.get('coordIndex')), new Given(node, child),
    node.get('colorPerVertex') ? (p, r, k) => inRuns?.[r]?.[k] ?? p : (p, r) => own ? index[r] : r);
}
function pointSet(node, child) {
  const {points, colors, lanes} = new Given(node, child);
  return made('points', points, {color: colors && Float32Array.from(colors), lanes});
}

/** Points of an arc from `start` to `end`, in radians; a whole circle where both are the same, or far apart (14.3.1). */
function arc(radius, start = 0, end = 0) {
  const whole = start === end || Math.abs(end - start) >= 2 * Math.PI;
  const span = whole ? 2 * Math.PI : ((end - start) % (2 * Math.PI) + 2 * Math.PI) % (2 * Math.PI);
  return count(kAround + 1).map((i) => [radius * Math.cos(start + span * i / kAround), radius * Math.sin(start + span * i / kAround)]);
}
function polyline(points) {
  return lines([count(points.length)], {points: Float32Array.from(points.flatMap(([x, y]) => [x, y, 0])), colors: null, lanes: 3});
}
/** Faces in the plane z = 0, seen from the front. */
function flat(faces) {
  const points = faces.flat().flatMap(([x, y]) => [x, y, 0]);
  let at = 0;
  const corners = faces.map((face) => face.map(() => Array(4).fill(at++)));
  return polygons(corners, {points: Float32Array.from(points), normals: null, colors: null, lanes: 3, texture: null});
}
const pairs = (list) => chunks(list, 2);
const kFlat = {
  Arc2D: (node) => polyline(arc(node.get('radius'), node.get('startAngle'), node.get('endAngle'))),
  ArcClose2D: (node) => {
    const round = arc(node.get('radius'), node.get('startAngle'), node.get('endAngle'));
    return flat(node.get('closureType') === 'CHORD' ? [round] : round.slice(1).map((p, i) => [[0, 0], round[i], p]));
  },
  Circle2D: (node) => polyline(arc(node.get('radius'))),
  Disk2D: (node) => {
    const outer = arc(node.get('outerRadius')), inner = arc(node.get('innerRadius'));
    if (node.get('innerRadius') === node.get('outerRadius')) return polyline(outer);
    return flat(node.get('innerRadius') > 0 ? outer.slice(1).map((p, i) => [outer[i], p, inner[i + 1], inner[i]]) : [outer.slice(1)]);
  },
  Polyline2D: (node) => polyline(pairs(node.get('lineSegments'))),
  Polypoint2D: (node) => made('points', pairs(node.get('point')).flatMap(([x, y]) => [x, y, 0])),
  Rectangle2D: (node) => {
    const [x, y] = node.get('size').map((side) => side / 2);
    return flat([[[-x, -y], [x, -y], [x, y], [-x, y]]]);
  },
  TriangleSet2D: (node) => flat(chunks(pairs(node.get('vertices')), 3)),
};

const kMakers = {
  IndexedFaceSet: indexedFaceSet, ElevationGrid: elevationGrid, Extrusion: extrusion, IndexedLineSet: indexedLineSet, PointSet: pointSet,
  LineSet: (node, child) => {
    const given = new Given(node, child);
    return lines(counted(node.get('vertexCount'), given.points.length / 3), given);
  },
  ...Object.fromEntries(Object.keys(kFaces).map((name) => [name, faceSet])), ...kPrimitives, ...kFlat,
};

/** Whether there is a way to show nodes of this type. */
export const isGeometry = (name) => Object.hasOwn(kMakers, name);
/** The arrays of a geometry node. `child(node, field, index)` is the node in a field, or null. */
export function arraysOf(node, child) {
  return kMakers[node.type.name](node, child);
}
