// Shows a replica by X_ITE: every node that can be seen has a node there, and every change is made there too.
//
// What acts at the origin does not act here: sensors of time, interpolators, scripts and ROUTEs have no counterpart, as what
// they do arrives as changes. A PROTO's instance is shown by the first node of its body, an Inline by a Group of its own.

import X3D from 'x_ite';

const MFNODE = 13, SFNODE = 12;
const NAMES = ['Bool', 'Int32', 'Float', 'Double', 'Time', 'String', 'Node', 'Color', 'ColorRGBA', 'Image', 'Vec2f', 'Vec2d', 'Vec3f',
  'Vec3d', 'Vec4f', 'Vec4d', 'Rotation', 'Matrix3f', 'Matrix3d', 'Matrix4f', 'Matrix4d'];
const kPlain = new Set([0, 1, 2, 3, 4, 5]);

/** Types whose doings come from the origin. */
const kActing = ['X3DTimeDependentNode', 'X3DInterpolatorNode', 'X3DScriptNode', 'X3DSequencerNode', 'X3DTriggerNode', 'X3DFollowerNode',
  'X3DEnvironmentalSensorNode', 'X3DKeyDeviceSensorNode', 'X3DNetworkSensorNode', 'X3DPickSensorNode', 'X3DSoundNode',
  'X3DSoundSourceNode', 'X3DSoundProcessingNode', 'X3DSoundChannelNode', 'X3DInfoNode', 'X3DMetadataObject', 'X3DPhysicsModelNode'];
const kShown = new Set(['MovieTexture']);
/** Shown by a Group: X_ITE's own would load files, and leave the page. */
const kGroups = new Set(['Inline', 'Anchor']);
const kLeftOut = new Set(['BooleanFilter', 'BooleanToggle', 'BooleanTrigger', 'IntegerTrigger', 'TimeTrigger', 'Script', 'CollisionSensor',
  'RigidBodyCollection', 'LoadSensor']);

/** Outputs say what happened at the origin; here nothing follows from them. */
const isKept = (def) => !def.hidden && (def.access === 'initializeOnly' || def.access === 'inputOutput');

/** Of pictures that shall come fast: a quarter of the pixels, and no shadows, which cost more than all the rest. */
const kCoarse = {Antialiased: false, PrimitiveQuality: 'LOW', TextureQuality: 'LOW', ContentScale: 0.5};
const kNoTangents = new Error('there are no maps of normals');
/** How long the first picture waits for those in the scene, ms. */
const kPicturesWithin = 700;
/** What draws where there is no GPU. */
const kSoftware = /swiftshader|llvmpipe|softpipe|software|basic render/i;

export class X3dView {
  /** `pictureUrl(id, index)`: of a texture's url of that index. `quality`: low, full, or else low where there is no GPU. */
  constructor(element, scene, {pictureUrl, quality}) {
    this.scene = scene;
    this.pictureUrl = pictureUrl;
    this.nodes = new Map();  // of X_ITE, by the replica's numbers
    this.canvas = X3D.createBrowser();
    this.browser = X3D.getBrowser(this.canvas);
    // As attributes, which show what is below the splash screen as well; before anything of it is laid out.
    this.canvas.setAttribute('splashScreen', 'false');
    this.canvas.setAttribute('contextMenu', 'false');
    this.canvas.setAttribute('notifications', 'false');
    this.canvas.style.visibility = 'hidden';  // until there is a picture: what is shown is composed, which takes its time without a GPU
    element.append(this.canvas);
    // Its own fonts are those of its menus and splash screen, of which nothing is shown.
    for (const face of [...document.fonts]) if (face.family.includes('X_ITE')) document.fonts.delete(face);
    this.drawnByCpu = kSoftware.test(this.browser.getRenderer());
    this.coarse = quality === 'low' || (quality !== 'full' && this.drawnByCpu);
    if (this.coarse)
      for (const [name, value] of Object.entries(kCoarse)) this.browser.setBrowserOption(name, value);
    this.building = null;
  }

  isShown(type) {
    if (type.kind !== 'built in') return type.kind !== 'Script';
    if (kShown.has(type.name)) return true;
    return !kLeftOut.has(type.name) && !type.implements.some((name) => kActing.includes(name));
  }
  hidden(node, name) {
    const index = node.type.fields.findIndex((f) => f.name === name && f.hidden);
    return index >= 0 && index in node.values ? node.values[index] : [];
  }
  /** What stands for a node here: itself, or for a PROTO's instance the first node of its body. */
  standIn(id) {
    for (let depth = 0; depth < 64; ++depth) {
      const node = this.scene.nodes.get(id);
      if (!node || node.type.kind === 'built in' || node.type.kind === 'Script') return id;
      id = this.hidden(node, 'body')[0] ?? 0;
    }
    return 0;
  }

  // ---- from the replica to X_ITE ---------------------------------------------------------------------------------

  /** All anew; false if another rebuild overtook this one. Nothing waits between reading the replica and following it. */
  async rebuild() {
    const own = this.building = {};
    const needed = new Set();
    for (const node of this.scene.nodes.values())
      if (node.type.kind === 'built in' && node.type.component && node.type.component !== 'RTSG') needed.add(node.type.component);
    const components = [];
    for (const name of needed) {
      try { components.push(this.browser.getComponent(name)); } catch { /* it has none of that name: nothing of it is shown */ }
    }
    const world = await this.browser.createScene(this.browser.getProfile('Interchange'), ...components);
    if (own !== this.building) return false;
    this.building = null;
    this.nodes.clear();
    this.world = world;
    this.chooseTangents();
    const roots = this.childrenOf(this.scene.root.get('children'));
    world.rootNodes = new X3D.MFNode(...roots);
    await this.pictures();
    if (world !== this.world) return false;
    // X_ITE says that it is done when everything has come, on a slow link much later: the frame after the one that it waits for is
    // the first of this world.
    const replaced = this.browser.replaceWorld(world), drawn = this.browser.nextFrame().then(() => this.browser.nextFrame());
    replaced.catch(() => {});  // by another one: so be it
    await Promise.race([replaced, drawn]);
    if (world !== this.world) return false;
    this.canvas.style.visibility = '';
    return true;
  }
  /** X_ITE makes tangents of every geometry, by a library that it fetches meanwhile: what was drawn before is then made again, with
   * other shaders. Only maps of normals need any. */
  chooseTangents() {
    const maker = X3D.require('MikkTSpace'), kMap = 'normalTexture';
    if (!maker) return;
    delete maker.isInitialized;  // as its class has it
    for (const {type, values} of this.scene.nodes.values())
      if (values[type.fields.findIndex((f) => f.name === kMap)]) return;
    maker.isInitialized = () => { throw kNoTangents; };  // caught where they would be made
  }
  /** Until the scene's pictures have come, or for a while: a first picture without them would take as long as the one with them,
   * and shaders of its own. What changes meanwhile is followed. */
  async pictures() {
    const coming = [...this.nodes.values()].map((made) => made.getValue())
      .filter((base) => base.checkLoadState?.() === X3D.X3DConstants.IN_PROGRESS_STATE);
    const all = Promise.allSettled(coming.map((base) => base.loading()));
    await Promise.race([all, new Promise((done) => setTimeout(done, kPicturesWithin))]);
  }

  childrenOf(ids) {
    const result = [];
    for (const id of ids) {
      const node = this.make(this.standIn(id));
      if (node) result.push(node);
    }
    return result;
  }

  /** X_ITE's node for this one, as an SFNode; null if it is none that is shown. */
  make(id) {
    if (!id) return null;
    if (this.nodes.has(id)) return this.nodes.get(id);
    const node = this.scene.nodes.get(id);
    if (!node || !this.isShown(node.type)) return null;
    const inlined = node.type.name === 'Inline';
    const base = this.world.createNode(kGroups.has(node.type.name) ? 'Group' : node.type.name, false);
    if (!base) return null;
    const made = new X3D.SFNode(base);
    this.nodes.set(id, made);
    if (inlined) {
      this.setChildren(base, 'children', this.hidden(node, 'body'));
    } else {
      node.type.fields.forEach((def, index) => {
        if (index in node.values && isKept(def)) this.setField(base, node, def, index);
      });
      if (node.name) base.setUserData?.('rtsg', node.name);
    }
    base.setup();
    return made;
  }
  touchSensor() {
    const base = this.world.createNode('TouchSensor', false);
    base.setup();
    return new X3D.SFNode(base);
  }

  setChildren(base, name, ids, ...more) {
    const field = base.getField(name, false);
    if (field) field.setValue([...this.childrenOf(ids), ...more]);
  }

  setField(base, node, def, index) {
    const field = base.getField(def.name, false), k = def.type >> 1;
    let value = node.values[index];
    if (!field) return;
    if (this.coarse && def.name === 'shadows') value = false;
    if (def.type === SFNODE) return field.setValue(this.make(this.standIn(value)));
    if (def.type === MFNODE) return this.setChildren(base, def.name, value, ...(node.type.name === 'Anchor' && def.name === 'children' ? [this.touchSensor()] : []));
    if (field.getTypeName() !== (def.type % 2 ? 'MF' : 'SF') + NAMES[k]) return;
    if (def.type % 2 === 0) {
      if (kPlain.has(k)) field.setValue(value);
      else if (NAMES[k] === 'Image') field.setValue(new X3D.SFImage(value[0] ?? 0, value[1] ?? 0, value[2] ?? 0, new X3D.MFInt32(...value.slice(3))));
      else field.setValue(new X3D[`SF${NAMES[k]}`](...value));
    } else if (def.name === 'url' && node.type.implements.includes('X3DTextureNode')) {
      field.setValue(value.map((url, i) => url.startsWith('data:') ? url : this.pictureUrl(node.id, i)));
    } else if (NAMES[k] !== 'Image') {
      field.setValue(value);
    }
  }

  /** `changed`: what a listener of Scene is given. */
  change(changed) {
    if (this.building || !this.world) return;  // what is built will be as it is then
    if (this.nodes.size > this.scene.nodes.size + 1000) this.prune();
    for (let i = 0; i < changed.length; i += 2) {
      const node = changed[i], index = changed[i + 1], def = node.type.fields[index];
      if (node.id === 1) {
        if (def.name === 'children') this.world.rootNodes = new X3D.MFNode(...this.childrenOf(node.values[index]));
        continue;
      }
      if (def.name === 'body' && def.hidden && this.rewire(node)) return;
      const made = this.nodes.get(node.id);
      if (!made || !isKept(def)) continue;
      try {
        this.setField(made.getValue(), node, def, index);
      } catch (error) {
        console.warn(`${node.type.name}.${def.name}: ${error.message}`);
      }
    }
  }
  /** A body came or went: of an Inline that is its Group's content; of a PROTO's instance everything that shows it. */
  rewire(node) {
    if (node.type.name !== 'Inline') {
      this.rebuild();
      return true;
    }
    const made = this.nodes.get(node.id);
    if (made) this.setChildren(made.getValue(), 'children', this.hidden(node, 'body'));
    return false;
  }
  /** Numbers are never used again; what is gone need not be kept. */
  prune() {
    for (const id of this.nodes.keys()) if (!this.scene.nodes.has(id)) this.nodes.delete(id);
  }

  // ---- viewpoints and pointers -------------------------------------------------------------------------------------

  /** [{id, name}], in the order of the document. */
  viewpoints() {
    const result = [];
    for (const [id, node] of this.scene.nodes)
      if (node.type.kind === 'built in' && node.type.implements.includes('X3DViewpointNode') && this.nodes.has(id))
        result.push({id, name: node.get('description') || node.name || `${node.type.name} ${id}`});
    return result;
  }
  /** That of the origin: the top of its active layer's stack. */
  originsViewpoint() {
    const {root} = this.scene;
    return this.hidden(this.scene.nodes.get(this.hidden(root, '_activeLayer')) ?? root, '_viewpointStack')[0] ?? 0;
  }
  bind(id) {
    const made = this.nodes.get(id);
    if (made) made.set_bind = true;
  }

  /** Where it is seen from: sixteen numbers, the rows right, up, back and position; null while there is no picture. */
  camera() {
    const view = this.building ? null : this.browser.getActiveLayer()?.getViewpoint();
    return view ? Array.from(view.getCameraSpaceMatrix()) : null;
  }
  /** The ray through a place on the page, as {origin, direction} in world space; null while there is no picture. */
  ray({pageX, pageY}) {
    const layer = this.building ? null : this.browser.getActiveLayer(), view = layer?.getViewpoint();
    if (!view) return null;
    const viewport = layer.getViewport().getRectangle(), near = view.getNearDistance(layer.getNavigationInfo());
    // Sixteen numbers, row by row: a place in the picture as a row, from -1 to 1 each way, times this is one in the world.
    const m = view.getProjectionMatrixWithLimits(near, 1000 * near, viewport).copy().inverse().multRight(view.getCameraSpaceMatrix());
    const at = this.browser.getPointerFromEvent({pageX, pageY});
    const x = (at.x - viewport.x) / viewport.z * 2 - 1, y = (at.y - viewport.y) / viewport.w * 2 - 1;
    const point = (depth) => {
      const [a, b, c, w] = [0, 1, 2, 3].map((k) => x * m[k] + y * m[4 + k] + depth * m[8 + k] + m[12 + k]);
      return [a / w, b / w, c / w];
    };
    const origin = point(-1), direction = point(0).map((c, i) => c - origin[i]), length = Math.hypot(...direction);
    return length > 0 && Number.isFinite(length) ? {origin, direction: direction.map((c) => c / length)} : null;
  }
  /** Whether the pointer was last seen over something that a sensor is for. */
  isOverSensor() { return this.browser.getHit().sensors.size > 0; }
}
