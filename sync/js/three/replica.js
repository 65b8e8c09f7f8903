// A replica of a scene as a THREE.Group: each object of three.js stands for one path to a node, and each change touches what it is about.
//
// Three kinds of things are kept. Objects (groups, meshes, lights, cameras), of each node as many as there are paths
// to it. Resources (a geometry, a material, a texture), one of each node, shared by all that use it, and made again when a node that
// they were made of changes. Batches: meshes with the same geometry and material, of which there are many, are drawn as one InstancedMesh.

import {
  AmbientLight, BufferAttribute, BufferGeometry, DirectionalLight, Fog, FogExp2, Group, InstancedMesh, LOD, LineSegments, Matrix4, Mesh, OrthographicCamera,
  PerspectiveCamera, PointLight, Points, Raycaster, SpotLight, Vector2, Vector3,
} from 'three';

import {PagePointer} from '../page/pointer.js';
import {arraysOf, isGeometry} from './geometry.js';
import {attenuate, displayed, fillMaterial, kindOf, makeMaterial, makeTexture, raw, setTextureMatrix} from './material.js';
import {makeSky} from './sky.js';

/** So many meshes of one geometry and material are drawn as one. */
const kBatch = 16;
/** Objects of one replica: USE in USE multiplies paths. */
const kMostObjects = 500_000, kDeepest = 500;
const kMoving = new Set(['translation', 'rotation', 'scale', 'scaleOrientation', 'center']);

const implementsType = (node, name) => node.type.name === name || node.type.implements.includes(name);
const isBuiltIn = (node) => node.type.kind === 'built in';
const hidden = (node, name) => {
  const index = node.type.fields.findIndex((f) => f.name === name && f.hidden);
  return index >= 0 && index in node.values ? node.values[index] : [];
};
/** Transform and its kind: HAnimJoint, CADPart. */
const moves = (node) => isBuiltIn(node) && node.type.fields.some((f) => f.name === 'scaleOrientation') && implementsType(node, 'X3DGroupingNode');
const valueOf = (node, name, otherwise) => node.type.fields.some((f) => f.name === name) ? node.get(name) : otherwise;

const kNothing = new BufferGeometry();
const a = new Matrix4(), b = new Matrix4(), v = new Vector3(), w = new Vector3();
const rotation = (matrix, [x, y, z, angle]) => {
  const length = Math.hypot(x, y, z);
  return length > 0 ? matrix.makeRotationAxis(v.set(x / length, y / length, z / length), angle) : matrix.identity();
};

/** Something made of nodes: `nodes` are those that it reads, found anew each time it is made. */
class Resource {
  constructor(id, make) {
    this.id = id;
    this.make = make;
    this.users = new Set();
    this.nodes = new Set();
    this.value = null;
  }
}

export class Replica extends Group {
  /** Follows the scene from now on, by its listener; one that is there already is called first. */
  constructor(scene, {pictureUrl = (id, index, url) => url.startsWith('data:') ? url : null, onTrouble = (text) => console.warn(text), batch = kBatch} = {}) {
    super();
    this.name = 'rtsg';
    this.scene = scene;
    this.pictureUrl = pictureUrl;
    this.onTrouble = onTrouble;
    this.batchFrom = batch;
    this.background = null;
    this.fog = null;
    this.headlight = new DirectionalLight(0xffffff, 0);
    this.headlight.matrixAutoUpdate = this.headlight.target.matrixAutoUpdate = false;
    this.ambient = new AmbientLight(0xffffff, 0);
    this.sky = null;
    this.add(this.headlight, this.headlight.target, this.ambient);
    this.top = new Group();
    this.top.matrixAutoUpdate = false;
    this.add(this.top);
    this.clear_();
    const before = scene.listener;
    this.listener = (changed) => {
      before?.(changed);
      this.change(changed);
    };
    scene.listener = this.listener;
    this.before = before;
    this.rebuild();
  }

  clear_() {
    this.objects = new Map();  // of each node, its objects
    this.resources = new Map();
    this.readers = new Map();  // of each node, the resources that read it
    this.batches = new Map();
    this.shapes = new Map();  // of each Shape, what it is drawn with
    this.moved = new Set();
    this.lights = new Set();
    this.ambientIsStale = true;
    this.count = 0;
    this.full = false;
  }
  /** Builds everything anew. */
  rebuild() {
    for (const object of [...this.top.children]) this.drop(object);
    for (const resource of this.resources.values()) resource.value?.dispose?.();
    for (const batch of this.batches.values()) batch.mesh?.removeFromParent();
    this.clear_();
    this.nodes = this.scene.nodes;  // a scene that begins anew has another map
    this.setChildren(this.top, this.rootChildren(), false);
    this.settle();
    this.setSurroundings();
  }
  /** Stops following, and frees what the graphics card holds. */
  dispose() {
    if (this.scene.listener === this.listener) this.scene.listener = this.before;
    for (const object of [...this.top.children]) this.drop(object);
    this.settle();
  }

  // ---- nodes ----------------------------------------------------------------------------------------------------------

  node(id) { return id ? this.scene.nodes.get(id) ?? null : null; }
  rootChildren() {
    const {root} = this.scene;
    return valueOf(root, 'children', []);
  }
  /** The node that stands for this one: of an instance of a PROTO, the first of its body. Each that is passed is noted. */
  standIn(id, passed = null) {
    for (let depth = 0; depth < 64; ++depth) {
      const node = this.node(id);
      passed?.add(id);
      if (!node || isBuiltIn(node)) return node;
      id = hidden(node, 'body')[0] ?? 0;
    }
    return null;
  }
  /** A function of (node, field, index): the node in a field, noted among those that `resource` reads. */
  childOf(nodes) {
    return (node, field, index = 0) => {
      const value = valueOf(node, field, 0);
      return this.standIn(typeof value === 'number' ? value : value[index] ?? 0, nodes);
    };
  }

  // ---- objects -----------------------------------------------------------------------------------------------------------

  /** Makes the children of an object those of `ids`, and keeps those that are there already. */
  setChildren(object, ids, apart) {
    const there = new Map();
    for (const child of object.userData.children ?? []) {
      const {id} = child.userData;
      if (!there.has(id)) there.set(id, []);
      there.get(id).push(child);
    }
    const now = [];
    for (const id of ids) {
      const kept = there.get(id)?.shift();
      const child = kept ?? this.make(id, apart, 1 + (object.userData.depth ?? 0));
      if (!child) continue;
      if (!kept) this.attach(object, child);
      now.push(child);
    }
    for (const rest of there.values()) for (const child of rest) this.drop(child);
    object.userData.children = now;
  }
  attach(object, child) {
    object.add(child);
    child.matrixWorldNeedsUpdate = true;
    this.moved.add(child);
  }
  /** An object of a node; null for one that is not shown. `apart`: three.js itself decides whether it is seen, so it is in no batch. */
  make(id, apart, depth) {
    const node = this.node(id), object = node && this.objectFor(node);
    if (!object) return null;
    if (this.count >= kMostObjects || depth > kDeepest) {
      if (!this.full) this.onTrouble(`more than ${kMostObjects} objects, or more than ${kDeepest} in one another: the others are left out`);
      this.full = true;
      return null;
    }
    ++this.count;
    object.matrixAutoUpdate = false;
    object.name = node.name;
    object.userData = {id, apart, depth, children: []};
    if (!this.objects.has(id)) this.objects.set(id, new Set());
    this.objects.get(id).add(object);
    if (object.isLight) this.lights.add(object);
    this.refresh(object, node);
    return object;
  }
  objectFor(node) {
    if (!isBuiltIn(node)) return node.type.kind === 'Script' ? null : new Group();
    const {name} = node.type;
    if (name === 'Shape') return new Mesh();
    if (name === 'LOD') return new LOD();
    if (name === 'DirectionalLight') return new DirectionalLight();
    if (name === 'PointLight') return new PointLight();
    if (name === 'SpotLight') return new SpotLight();
    if (name === 'Viewpoint') return new PerspectiveCamera();
    if (name === 'OrthoViewpoint') return new OrthographicCamera();
    const groups = ['X3DGroupingNode', 'StaticGroup', 'Inline', 'Layer', 'LayerSet', 'CADFace', 'X3DLayerNode'];
    return groups.some((group) => implementsType(node, group)) ? new Group() : null;
  }
  /** Takes an object away, and all below it. */
  drop(object) {
    for (const child of object.userData.children ?? []) this.drop(child);
    object.removeFromParent();
    object.target?.removeFromParent();
    --this.count;
    const {id} = object.userData, all = this.objects.get(id);
    all?.delete(object);
    this.moved.delete(object);
    if (this.lights.delete(object)) this.ambientIsStale = true;
    if (object.isLeaf) this.leave(object);
    if (all?.size) return;
    this.objects.delete(id);
    const shape = this.shapes.get(id);
    if (shape) {
      this.shapes.delete(id);
      shape.users.geometry?.users.delete(id);
      shape.users.material?.users.delete(id);
      this.unused(shape.users.geometry);
      this.unused(shape.users.material);
    }
  }
  /** Sets everything of an object as its node says. */
  refresh(object, node) {
    if (!isBuiltIn(node)) return this.setChildren(object, hidden(node, 'body').slice(0, 1), object.userData.apart);
    if (object.isLight) return this.setLight(object, node);
    if (object.isCamera) return this.setCamera(object, node);
    if (node.type.name === 'Shape') return this.setShape(object, node);
    if (moves(node)) this.setTransform(object, node);
    if (object.isLOD) return this.setLevels(object, node);
    this.setChildren(object, this.shownChildren(node), object.userData.apart);
  }
  shownChildren(node) {
    if (valueOf(node, 'visible', true) === false) return [];
    switch (node.type.name) {
    case 'Inline': return hidden(node, 'body');
    case 'CADFace': return [node.get('shape')];
    case 'LayerSet': return node.get('layers');
    case 'Switch': {
      const chosen = node.get('children')[node.get('whichChoice')];
      return chosen === undefined ? [] : [chosen];
    }
    default: return valueOf(node, 'children', []);
    }
  }
  setLevels(object, node) {
    const children = Array.from(node.get('children')), range = node.get('range'), center = node.get('center');
    this.setChildren(object, valueOf(node, 'visible', true) ? children : [], true);
    object.levels.length = 0;
    object.userData.children.forEach((child, i) => object.levels.push({object: child, distance: i ? range[i - 1] ?? Infinity : 0, hysteresis: 0}));
    if (center.some((x) => x !== 0)) this.onTrouble(`LOD ${node.id}: distances are from its origin, not its center`);
  }
  setTransform(object, node) {
    const center = node.get('center'), scale = node.get('scale'), lean = node.get('scaleOrientation'), [x, y, z] = node.get('translation');
    const {matrix} = object, turn = node.get('rotation');
    rotation(matrix, turn);
    if (scale[0] !== 1 || scale[1] !== 1 || scale[2] !== 1) {
      const leans = lean[3] !== 0 && (scale[0] !== scale[1] || scale[1] !== scale[2]);
      if (leans) matrix.multiply(rotation(a, lean));
      matrix.scale(w.set(...scale));
      if (leans) matrix.multiply(rotation(a, [lean[0], lean[1], lean[2], -lean[3]]));
    }
    const [cx, cy, cz] = center;
    const after = v.set(-cx, -cy, -cz).applyMatrix4(matrix);
    matrix.setPosition(after.x + cx + x, after.y + cy + y, after.z + cz + z);
    matrix.decompose(object.position, object.quaternion, object.scale);
    object.matrixWorldNeedsUpdate = true;
    this.moved.add(object);
  }

  // ---- lights and viewpoints -----------------------------------------------------------------------------------------------

  setLight(light, node) {
    raw(light.color, node.get('color'));
    light.intensity = node.get('on') ? Math.PI * node.get('intensity') : 0;
    if (light.isPointLight || light.isSpotLight) {
      attenuate(light, node.get('attenuation'));
      light.position.set(...node.get('location'));
    }
    if (light.isDirectionalLight || light.isSpotLight) {
      if (!light.target.parent) light.add(light.target);
      light.target.position.set(...node.get('direction'));
      light.target.updateMatrix();
    }
    if (light.isDirectionalLight) light.position.set(0, 0, 0);
    if (light.isSpotLight) {
      light.angle = Math.min(node.get('cutOffAngle'), Math.PI / 2);
      light.penumbra = light.angle > 0 ? Math.max(0, 1 - node.get('beamWidth') / light.angle) : 0;
    }
    light.updateMatrix();
    light.matrixWorldNeedsUpdate = true;
    light.userData.ambient = node.get('on') ? node.get('ambientIntensity') : 0;
    this.ambientIsStale = true;
  }
  /** The ambient light of all lights together; that of lights at places as it is five metres away. */
  sumAmbient() {
    this.ambientIsStale = false;
    this.ambient.color.setRGB(0, 0, 0);
    for (const light of this.lights) {
      const share = light.userData.ambient * (light.decay === undefined ? 1 : 5 ** -light.decay * light.intensity / (Math.PI * (this.node(light.userData.id)?.get('intensity') || 1)));
      this.ambient.color.r += share * light.color.r;
      this.ambient.color.g += share * light.color.g;
      this.ambient.color.b += share * light.color.b;
    }
    this.ambient.intensity = Math.PI;
  }
  setCamera(camera, node) {
    camera.position.set(...node.get('position'));
    const [x, y, z, angle] = node.get('orientation');
    camera.quaternion.setFromAxisAngle(v.set(x, y, z).normalize(), angle);
    camera.updateMatrix();
    camera.matrixWorldNeedsUpdate = true;
  }
  /** The viewpoints that are shown: [{id, name}]. */
  viewpoints() {
    return [...this.objects].filter(([, all]) => [...all][0].isCamera).map(([id]) => {
      const node = this.node(id);
      return {id, name: node.get('description') || node.name || `${node.type.name} ${id}`};
    });
  }
  /** The node at the top of a stack of the origin's: the one that is bound. */
  bound(stack) {
    const {root} = this.scene, layer = this.node(hidden(root, '_activeLayer')) ?? root;
    return this.node(hidden(layer, stack)[0]);
  }
  /** Places a camera at a viewpoint, by default the one that is bound at the origin, for a picture of this aspect.
   * Returns the viewpoint's number; 0 where there is none: the camera is then at X3D's default. */
  look(camera, aspect = camera.aspect ?? 1, id = this.bound('_viewpointStack')?.id ?? 0) {
    const from = [...this.objects.get(id) ?? []][0], node = from?.isCamera ? this.node(id) : null;
    if (node) {
      from.updateWorldMatrix(true, false);
      from.matrixWorld.decompose(camera.position, camera.quaternion, w);
    } else {
      camera.position.set(0, 0, 10);
      camera.quaternion.identity();
    }
    if (camera.isPerspectiveCamera) {
      // X3D's angle is that of the picture's shorter side (23.4.6).
      const angle = node?.type.name === 'Viewpoint' ? node.get('fieldOfView') : Math.PI / 4;
      camera.fov = (aspect >= 1 ? angle : 2 * Math.atan(Math.tan(angle / 2) / aspect)) * 180 / Math.PI;
      camera.aspect = aspect;
    } else if (node?.type.name === 'OrthoViewpoint') {
      const [left, bottom, right, top] = node.get('fieldOfView'), wide = Math.max(1, aspect * (top - bottom) / (right - left)), tall = Math.max(1, (right - left) / (top - bottom) / aspect);
      Object.assign(camera, {left: left * wide, right: right * wide, top: top * tall, bottom: bottom * tall});
    }
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    return node ? id : 0;
  }
  /** Call it before each picture: the headlight goes with the camera. */
  update(camera) {
    const navigation = this.bound('_navigationStack');
    this.headlight.intensity = !navigation || navigation.get('headlight') ? Math.PI : 0;
    this.updateWorldMatrix(true, false);
    if (this.headlight.intensity) {
      a.copy(this.matrixWorld).invert().multiply(camera.matrixWorld);
      this.headlight.matrix.identity().setPosition(v.set(0, 0, 1).transformDirection(a));
      this.headlight.matrixWorldNeedsUpdate = true;
    }
    if (this.sky) {
      a.copy(this.matrixWorld).invert();
      this.sky.position.setFromMatrixPosition(camera.matrixWorld).applyMatrix4(a);
      // Between the planes of the camera, as what lies outside them is not drawn.
      this.sky.scale.setScalar(2 * (camera.near > 0 ? camera.near : 1));
      this.sky.updateMatrix();
    }
    const found = this.parent?.isScene ? this.parent : null;
    if (found) Object.assign(found, {background: this.background, fog: this.fog});
  }
  /** The background and the fog that are bound; update() gives them to the THREE.Scene that this is in. */
  setSurroundings() {
    const background = this.bound('_backgroundStack'), fog = this.bound('_fogStack');
    const sky = background ? valueOf(background, 'skyColor', []) : [];
    this.background = displayed(sky.length >= 3 ? Array.from(sky.slice(0, 3)) : [0, 0, 0]);
    this.sky?.removeFromParent();
    this.sky?.geometry.dispose();
    this.sky = background?.type.name === 'Background' ? makeSky(background) : null;
    if (this.sky) this.add(this.sky);
    const range = fog?.type.name === 'Fog' ? fog.get('visibilityRange') : 0;
    this.fog = range > 0 ? fog.get('fogType') === 'EXPONENTIAL' ? new FogExp2(0, 2 / range) : new Fog(0, 0, range) : null;
    if (this.fog) raw(this.fog.color, fog.get('color'));
  }

  // ---- shapes ------------------------------------------------------------------------------------------------------------------

  /** What a Shape is drawn with, made for its first object. */
  shapeOf(node) {
    let shape = this.shapes.get(node.id);
    if (!shape) this.shapes.set(node.id, shape = this.choose({id: node.id, node, users: {}, extra: new Set()}));
    return shape;
  }
  /** Chooses geometry and material of a Shape. */
  choose(shape) {
    const {node} = shape, own = this.childOf(shape.extra = new Set([node.id])), before = shape.users;
    shape.users = {geometry: null, material: null};
    const geometry = valueOf(node, 'visible', true) === false ? null : own(node, 'geometry');
    if (geometry && isGeometry(geometry.type.name)) {
      shape.users.geometry = this.use(`g${geometry.id}`, shape.id, geometry.id, (resource) => this.makeGeometry(resource, geometry));
      const {kind, lanes, color} = shape.users.geometry.value.userData;
      Object.assign(shape, {kind, lanes, color, solid: valueOf(geometry, 'solid', true), ccw: true});
      const appearance = own(node, 'appearance'), looks = kindOf(shape, this.childOf(shape.extra));
      shape.users.material = this.use(`m${appearance?.id ?? 0} ${looks}`, shape.id, appearance?.id ?? 0, (resource) => this.makeMaterial(resource, looks, appearance));
    } else if (geometry) {
      this.onTrouble(`${geometry.type.name} ${geometry.id} is not shown`);
    }
    for (const name of ['geometry', 'material']) {
      if (before[name] && before[name] !== shape.users[name]) {
        before[name].users.delete(shape.id);
        this.unused(before[name]);
      }
    }
    this.read(shape, shape.extra);
    return shape;
  }
  setShape(object, node) {
    const {geometry, material} = this.shapeOf(node).users;
    this.leave(object);
    object.isLeaf = true;
    object.visible = geometry !== null;
    object.geometry = geometry?.value ?? kNothing;
    if (!geometry) return;
    const {kind} = geometry.value.userData;
    object.material = material.value;
    // A Mesh draws lines and points as well, if it says that it is one of these.
    object.isMesh = kind === 'triangles' || undefined;
    object.isLineSegments = object.isLine = kind === 'lines' || undefined;
    object.isPoints = kind === 'points' || undefined;
    object.raycast = {triangles: Mesh, lines: LineSegments, points: Points}[kind].prototype.raycast;
    if (kind === 'triangles' && !object.userData.apart) this.join(object, geometry, material);
  }

  /** The resource of this key, made if there is none. */
  use(key, user, id, make) {
    let resource = this.resources.get(key);
    if (!resource) {
      resource = new Resource(id, make);
      resource.key = key;
      this.resources.set(key, resource);
      this.remake(resource);
    }
    resource.users.add(user);
    return resource;
  }
  remake(resource) {
    const nodes = new Set([resource.id]);
    const used = resource.used ?? new Set();
    resource.used = new Set();
    resource.value = resource.make({resource, value: resource.value, child: this.childOf(nodes), nodes});
    this.read(resource, nodes);
    for (const other of used) {
      if (resource.used.has(other)) continue;
      other.users.delete(resource);
      this.unused(other);
    }
  }
  /** Notes which nodes a resource or a shape was made of. */
  read(reader, nodes) {
    for (const id of reader.nodes ?? []) {
      if (nodes.has(id)) continue;
      const all = this.readers.get(id);
      all?.delete(reader);
      if (!all?.size) this.readers.delete(id);
    }
    for (const id of nodes) {
      if (!this.readers.has(id)) this.readers.set(id, new Set());
      this.readers.get(id).add(reader);
    }
    reader.nodes = nodes;
  }
  unused(resource) {
    if (!resource || resource.users.size) return;
    this.read(resource, new Set());
    this.resources.delete(resource.key);
    resource.value?.dispose?.();
    for (const other of resource.used ?? []) {
      other.users.delete(resource);
      this.unused(other);
    }
  }

  makeGeometry({value, child}, node) {
    const geometry = value ?? new BufferGeometry();
    let arrays = {kind: 'triangles', position: new Float32Array(0)};
    try {
      arrays = arraysOf(node, child);
    } catch (error) {
      this.onTrouble(`${node.type.name} ${node.id}: ${error.message}`);
    }
    for (const [name, size] of [['position', 3], ['normal', 3], ['uv', 2], ['color', arrays.lanes]]) {
      const now = arrays[name], there = geometry.attributes[name];
      if (!now) geometry.deleteAttribute(name);
      else if (there?.array.length === now.length && there.itemSize === size) there.copyArray(now).needsUpdate = true;
      else geometry.setAttribute(name, new BufferAttribute(now, size));
    }
    Object.assign(geometry.userData, {kind: arrays.kind, lanes: arrays.lanes ?? 3, color: Boolean(arrays.color)});
    geometry.boundingSphere = geometry.boundingBox = null;
    return geometry;
  }
  makeMaterial({resource, value, child}, looks, appearance) {
    const material = value ?? makeMaterial(looks);
    fillMaterial(material, looks, appearance, child, (node, transform, encoded) => {
      const texture = this.use(`t${node.id} ${transform?.id ?? 0} ${encoded}`, resource, node.id, ({resource: own, value: before, nodes}) => {
        before?.dispose();
        if (transform) nodes.add(transform.id);
        const made = makeTexture(node, encoded, this.pictureUrl, (error) => {
          if (error) this.onTrouble(error.message);
          this.remakeUsers(own);
        });
        if (made) setTextureMatrix(made, transform);
        return made;
      });
      resource.used.add(texture);
      return texture.value;
    });
    return material;
  }
  /** After a picture has come: what it lets through is known. */
  remakeUsers(resource) {
    for (const user of resource?.users ?? []) if (this.resources.get(user.key) === user) this.remake(user);
  }

  // ---- batches --------------------------------------------------------------------------------------------------------------------

  join(object, geometry, material) {
    const key = `${geometry.key} ${material.key}`;
    let batch = this.batches.get(key);
    if (!batch) this.batches.set(key, batch = {key, geometry, material, meshes: [], mesh: null});
    object.batch = batch;
    object.place = batch.meshes.push(object) - 1;
    if (batch.mesh || batch.meshes.length >= this.batchFrom) this.fit(batch);
    this.moved.add(object);
  }
  leave(object) {
    const {batch} = object;
    if (!batch) return;
    const last = batch.meshes.pop();
    if (last !== object) {
      batch.meshes[object.place] = last;
      last.place = object.place;
      this.moved.add(last);
    }
    object.batch = null;
    object.visible = true;
    if (batch.mesh) batch.mesh.count = batch.meshes.length;
    if (batch.meshes.length) return;
    batch.mesh?.removeFromParent();
    batch.mesh?.dispose();
    this.batches.delete(batch.key);
  }
  /** Makes room for all of a batch, which is then drawn as one. */
  fit(batch) {
    const {meshes} = batch;
    if (!batch.mesh || batch.mesh.instanceMatrix.count < meshes.length) {
      const {mesh: before} = batch, mesh = batch.mesh = new InstancedMesh(batch.geometry.value, batch.material.value, Math.max(2 * meshes.length, 64));
      if (before) {
        mesh.instanceMatrix.array.set(before.instanceMatrix.array);
        before.removeFromParent();
        before.dispose();
      } else {
        for (const each of meshes) this.moved.add(each);
      }
      mesh.frustumCulled = false;
      mesh.matrixAutoUpdate = false;
      mesh.raycast = () => {};  // its meshes answer, each with its path
      this.add(mesh);
    }
    batch.mesh.count = meshes.length;
    for (const each of meshes) each.visible = false;
  }

  /** Gives the batches the places of what has moved: of that and what is below it alone. */
  settle() {
    for (const object of this.moved) {
      if (!object.parent) continue;
      b.identity();
      for (let up = object.parent; up && up !== this; up = up.parent) b.premultiply(up.matrix);
      this.settleBelow(object, b);
    }
    this.moved.clear();
    if (this.ambientIsStale) this.sumAmbient();
  }
  settleBelow(object, above) {
    const {children} = object.userData;
    if (object.batch?.mesh) {
      const {mesh} = object.batch, to = object.place;
      a.multiplyMatrices(above, object.matrix).toArray(mesh.instanceMatrix.array, 16 * to);
      mesh.instanceMatrix.needsUpdate = true;
    }
    if (!children?.length) return;
    const own = new Matrix4().multiplyMatrices(above, object.matrix);
    for (const child of children) this.settleBelow(child, own);
  }

  // ---- changes ---------------------------------------------------------------------------------------------------------------------

  /** `changed` is the argument of a Scene's listener. */
  change(changed) {
    if (this.nodes !== this.scene.nodes) return this.rebuild();
    const stale = new Set(), again = new Map();  // resources and shapes to make again; objects' nodes to refresh, and whether all of them
    let surroundings = false;
    for (let i = 0; i < changed.length; i += 2) {
      const node = changed[i], def = node.type.fields[changed[i + 1]];
      if (node.id === 1) {
        if (def.name === 'children') this.setChildren(this.top, this.rootChildren(), false);
        else if (def.hidden) surroundings = true;
        continue;
      }
      if (this.objects.has(node.id)) again.set(node.id, (again.get(node.id) ?? true) && kMoving.has(def.name));
      for (const reader of this.readers.get(node.id) ?? []) stale.add(reader);
      surroundings ||= implementsType(node, 'X3DBackgroundNode') || node.type.name === 'Fog' || def.hidden;
    }
    for (const [id, onlyMoves] of again) {
      const node = this.node(id);
      if (!node || node.type.name === 'Shape') continue;  // shapes are among the readers
      for (const object of [...this.objects.get(id) ?? []]) {
        if (onlyMoves && moves(node)) this.setTransform(object, node);
        else this.refresh(object, node);
      }
    }
    this.makeAgain(stale);
    this.settle();
    if (surroundings) this.setSurroundings();
  }
  makeAgain(stale) {
    const shapes = new Set();
    for (const reader of stale) {
      if (!(reader instanceof Resource)) {
        shapes.add(reader);
        continue;
      }
      if (this.resources.get(reader.key) !== reader || !this.node(reader.id)) continue;
      this.remake(reader);
      for (const user of reader.users) {
        if (user instanceof Resource) this.remake(user);  // a texture has another picture
        else if (this.shapes.has(user)) shapes.add(this.shapes.get(user));
      }
    }
    for (const shape of shapes) {
      if (this.shapes.get(shape.id) !== shape || !this.node(shape.id)) continue;
      const {geometry, material} = shape.users;
      this.choose(shape);
      if (geometry === shape.users.geometry && material === shape.users.material) continue;
      for (const object of this.objects.get(shape.id) ?? []) this.setShape(object, shape.node);
    }
  }

  // ---- pointers -----------------------------------------------------------------------------------------------------------------------

  /** The ray through a place on the page, in the scene's space, for PagePointer. */
  ray({clientX, clientY}, camera, element) {
    const box = element.getBoundingClientRect(), caster = new Raycaster();
    caster.setFromCamera(new Vector2((clientX - box.left) / box.width * 2 - 1, 1 - (clientY - box.top) / box.height * 2), camera);
    this.updateWorldMatrix(true, false);
    a.copy(this.matrixWorld).invert();
    const origin = caster.ray.origin.clone().applyMatrix4(a), direction = caster.ray.direction.clone().transformDirection(a);
    return origin.toArray().concat(direction.toArray()).every(Number.isFinite) ? {origin: origin.toArray(), direction: direction.toArray()} : null;
  }
  /** Sends what a mouse, a pen or a finger does on `element` to the origin, whose sensors act. */
  point(element, mirror, camera) {
    return new PagePointer(element, mirror, (event) => this.ray(event, camera, element));
  }
}
